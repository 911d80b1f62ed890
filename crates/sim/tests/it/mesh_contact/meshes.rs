//! The meshes of the scenes.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::Point3;
use prehend_geometry::TriMesh;
use prehend_geometry::shapes::tube;

/// Radius of the hook's rod \[m\].
pub(crate) const ROD: f64 = 4e-3;

/// A hook: a rod from a wall at x = 0 along x, that turns up at its end; z up.
pub(crate) fn hook() -> TriMesh {
    let (length, bend) = (0.05, 0.012);
    let mut path: Vec<Point3<f64>> =
        (0..20).map(|i| Point3::new(length * f64::from(i) / 20.0, 0.0, 0.0)).collect();
    path.extend((0..=8).map(|i| {
        let (sin, cos) = (FRAC_PI_2 * f64::from(i) / 8.0).sin_cos();
        Point3::new(length + bend * sin, 0.0, bend * (1.0 - cos))
    }));
    path.extend((1..4).map(|i| Point3::new(length + bend, 0.0, bend + 2.5e-3 * f64::from(i))));
    tube(&path, ROD, 16, 4)
}

/// A round thread around z: radii about a middle one, in columns around z.
#[derive(Clone, Copy)]
pub(crate) struct Thread {
    /// Middle radius, half the depth, and the pitch \[m\].
    pub(crate) radius: f64,
    pub(crate) amplitude: f64,
    pub(crate) pitch: f64,
    pub(crate) columns: usize,
    /// Rows a turn.
    pub(crate) rows: usize,
}

impl Thread {
    /// A point of the surface, in a column and at a height \[m\].
    fn at(&self, column: usize, z: f64) -> Point3<f64> {
        let turn = column as f64 / self.columns as f64;
        let radius = self.radius + self.amplitude * (TAU * (z / self.pitch - turn)).cos();
        let (sin, cos) = (TAU * turn).sin_cos();
        Point3::new(radius * cos, radius * sin, z)
    }

    /// Rows of vertices from one height to another \[m\], column by column.
    fn surface(&self, [from, to]: [f64; 2]) -> (Vec<Point3<f64>>, usize) {
        let cells = ((to - from) / self.pitch * self.rows as f64).round() as usize;
        let height = |i: usize| from + (to - from) * i as f64 / cells as f64;
        let column = |j| (0..=cells).map(move |i| self.at(j, height(i)));
        ((0..self.columns).flat_map(column).collect(), cells + 1)
    }
}

/// A rod with a thread between two heights \[m\].
pub(crate) fn bolt(thread: &Thread, heights: [f64; 2]) -> TriMesh {
    let (vertices, rows) = thread.surface(heights);
    let columns = thread.columns;
    let at = |j: usize, i: usize| (j % columns * rows + i) as u32;
    let mut mesh = TriMesh::new(vertices, Vec::new());
    let [bottom, top] = [0, 1].map(|i| (mesh.vertices.len() + i) as u32);
    mesh.vertices.extend(heights.map(|z| Point3::new(0.0, 0.0, z)));
    for j in 0..columns {
        for i in 0..rows - 1 {
            let [a, b, c, d] = [at(j, i), at(j + 1, i), at(j + 1, i + 1), at(j, i + 1)];
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
        mesh.faces.push([bottom, at(j + 1, 0), at(j, 0)]);
        mesh.faces.push([top, at(j, rows - 1), at(j + 1, rows - 1)]);
    }
    mesh
}

/// A hexagonal nut with a thread between two heights \[m\], `width` \[m\] across its flats. The thread has a multiple of six columns.
pub(crate) fn nut(thread: &Thread, heights: [f64; 2], width: f64) -> TriMesh {
    let (inner, rows) = thread.surface(heights);
    let columns = thread.columns;
    let outer = |j: usize, z: f64| {
        let angle = TAU * j as f64 / columns as f64;
        // From the middle of a flat.
        let off = (angle + PI / 6.0).rem_euclid(PI / 3.0) - PI / 6.0;
        let (sin, cos) = angle.sin_cos();
        let radius = 0.5 * width / off.cos();
        Point3::new(radius * cos, radius * sin, z)
    };
    let first = inner.len();
    let mut mesh = TriMesh::new(inner, Vec::new());
    mesh.vertices.extend((0..columns).flat_map(|j| heights.map(|z| outer(j, z))));
    let bore = |j: usize, i: usize| (j % columns * rows + i) as u32;
    let side = |j: usize, i: usize| (first + 2 * (j % columns) + i) as u32;
    let mut square = |[a, b, c, d]: [u32; 4]| mesh.faces.extend([[a, b, c], [a, c, d]]);
    for j in 0..columns {
        for i in 0..rows - 1 {
            square([bore(j, i), bore(j, i + 1), bore(j + 1, i + 1), bore(j + 1, i)]);
        }
        square([side(j, 0), side(j + 1, 0), side(j + 1, 1), side(j, 1)]);
        square([bore(j, 0), bore(j + 1, 0), side(j + 1, 0), side(j, 0)]);
        let top = rows - 1;
        square([bore(j, top), side(j, 1), side(j + 1, 1), bore(j + 1, top)]);
    }
    mesh
}
