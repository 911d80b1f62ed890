//! The body that closest points and distance grids are timed on.

use std::f64::consts::{PI, TAU};

use nalgebra::{Point3, Vector3};
use prehend_geometry::TriMesh;

/// An ellipsoid of 5 × 5 × 7 cm half axes with smooth bumps: 16 128 faces, closed, in metres.
pub(crate) fn body() -> TriMesh {
    let (around, along) = (128, 64);
    let phase = [0.5118216247, 0.9504636963, 0.1441596113, 0.9486494471].map(|x| x * TAU);
    let mut vertices = Vec::new();
    for i in 1..along {
        let t = PI * i as f64 / along as f64;
        for j in 0..around {
            let a = TAU * j as f64 / around as f64;
            let ring = t.sin().powi(2);
            let broad = (3.0 * t + phase[0]).sin() * ring * (4.0 * a + phase[1]).cos();
            let fine = (5.0 * t + phase[2]).cos() * ring * (7.0 * a + phase[3]).sin();
            let r = 0.05 * (1.0 + 0.15 * broad + 0.075 * fine);
            let direction = Vector3::new(t.sin() * a.cos(), t.sin() * a.sin(), 1.4 * t.cos());
            vertices.push(Point3::from(direction * r));
        }
    }
    let top = vertices.len() as u32;
    vertices.extend([Point3::new(0.0, 0.0, 0.07), Point3::new(0.0, 0.0, -0.07)]);
    let at = |i: usize, j: usize| (i * around + j % around) as u32;
    let mut faces = Vec::new();
    for j in 0..around {
        faces.push([top, at(0, j), at(0, j + 1)]);
        faces.push([top + 1, at(along - 2, j + 1), at(along - 2, j)]);
        for i in 0..along - 2 {
            faces.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
            faces.push([at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)]);
        }
    }
    TriMesh::new(vertices, faces)
}
