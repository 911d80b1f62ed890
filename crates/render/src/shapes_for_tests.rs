//! Watertight shapes for this crate's tests, beside those of `prehend_geometry::shapes`.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use prehend_geometry::shapes::cuboid;
use prehend_geometry::{Texture, TriMesh};

/// A torus around z \[m\].
pub(crate) fn torus(major: f64, minor: f64, rings: usize) -> TriMesh {
    grid(2 * rings, rings, |u, v| {
        let (phi, theta) = (TAU * u, TAU * v);
        let r = major - minor * theta.cos();
        Vector3::new(r * phi.cos(), r * phi.sin(), -minor * theta.sin())
    })
}

/// A smooth lump without symmetry, about `radius` large \[m\].
pub(crate) fn lump(radius: f64, rings: usize) -> TriMesh {
    grid(rings, rings, |u, v| {
        let (phi, theta) = (TAU * u, PI * v);
        let p = Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), -theta.cos());
        let r = 1.0 + 0.15 * (2.0 * p.x + 1.0).sin() + 0.12 * (3.0 * p.y - p.z).cos();
        Vector3::new(p.x * 0.7 * r, p.y * r, p.z * 1.3 * r) * radius
    })
}

/// Paints vertex colors that vary smoothly over about `period` \[m\].
pub(crate) fn painted(mut mesh: TriMesh, period: f64) -> TriMesh {
    let k = TAU / period;
    let color = |p: &Point3<f64>| {
        [
            0.5 + 0.35 * (k * (p.x + 0.5 * p.y)).sin(),
            0.55 + 0.3 * (k * (p.y - 0.7 * p.z) + 1.0).sin(),
            0.5 + 0.4 * (k * (p.z + 0.3 * p.x) + 2.0).cos(),
        ]
        .map(|v| v as f32)
    };
    mesh.colors = Some(mesh.vertices.iter().map(color).collect());
    mesh
}

/// A box with a smooth texture of `size` texels that varies over about `period` of them, projected obliquely so that it
/// runs on across the edges \[m\].
pub(crate) fn textured_box([width, height]: [usize; 2], period: [f64; 2]) -> TriMesh {
    let mut mesh = cuboid(Vector3::new(0.06, 0.08, 0.1));
    let uv = |p: &Point3<f64>| {
        [0.5 + 4.0 * (p.x + 0.6 * p.z), 0.5 + 4.0 * (p.y - 0.5 * p.z + 0.2 * p.x)]
    };
    mesh.uvs = Some(mesh.vertices.iter().map(|p| uv(p).map(|v| v as f32)).collect());
    let pixels = (0..width * height).map(|i| {
        let (x, y) = ((i % width) as f64 / period[0], (i / width) as f64 / period[1]);
        [x.sin() + 0.3 * y.cos(), (0.7 * x + y).cos(), (0.4 * x - y).sin()]
            .map(|v| (140.0 + 80.0 * v) as u8)
    });
    mesh.texture = Some(Arc::new(Texture { width, height, pixels: pixels.collect() }));
    mesh
}

/// Closed in both directions by welding; u runs around, v from one pole to the other.
fn grid(nu: usize, nv: usize, at: impl Fn(f64, f64) -> Vector3<f64>) -> TriMesh {
    let mut vertices = Vec::new();
    for j in 0..=nv {
        for i in 0..=nu {
            // The seam repeats exactly, so that it welds.
            let (u, v) = ((i % nu) as f64 / nu as f64, j as f64 / nv as f64);
            vertices.push(Point3::from(at(u, v)));
        }
    }
    let index = |i: usize, j: usize| (j * (nu + 1) + i) as u32;
    let mut faces = Vec::new();
    for j in 0..nv {
        for i in 0..nu {
            let (a, b, c, d) = (index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1));
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    TriMesh::new(vertices, faces)
}
