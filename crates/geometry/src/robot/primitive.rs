//! Triangle meshes of URDF's primitive shapes.

use std::f64::consts::{PI, TAU};

use nalgebra::{Point3, Vector3};

use crate::TriMesh;

/// Sides of a tessellated circle. Corners lie on the true surface, so a mesh is nowhere more than
/// `radius * (1 - cos(π / 48))` = 0.21 % of the radius inside it (34 µm at 15.7 mm; twice as much on a sphere).
const SIDES: usize = 48;

/// An exact box of twelve triangles around the origin; `size` is its full size \[m\].
pub fn cuboid(size: &Vector3<f64>) -> TriMesh {
    let vertices = (0..8)
        .map(|i| {
            Point3::from(Vector3::from_fn(|a, _| {
                size[a] * if i >> a & 1 == 1 { 0.5 } else { -0.5 }
            }))
        })
        .collect();
    let quads =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    TriMesh::new(vertices, quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

/// A cylinder of 48 sides about the z axis, centred at the origin \[m\].
pub fn cylinder(radius: f64, length: f64) -> TriMesh {
    let half = 0.5 * length;
    lathe(&[(0.0, half), (radius, half), (radius, -half), (0.0, -half)])
}

/// A sphere of 48 meridians and 24 bands around the origin \[m\].
pub fn sphere(radius: f64) -> TriMesh {
    capsule(radius, 0.0)
}

/// A cylinder of `length` about the z axis closed by half spheres \[m\].
pub(super) fn capsule(radius: f64, length: f64) -> TriMesh {
    let bands = SIDES / 2;
    let mut profile = Vec::with_capacity(bands + 2);
    for i in 0..=bands {
        let (sin, cos) = (PI * i as f64 / bands as f64).sin_cos();
        let r = if i == 0 || i == bands { 0.0 } else { radius * sin };
        let z = radius * cos;
        if 2 * i <= bands {
            profile.push((r, z + 0.5 * length));
        }
        if 2 * i > bands || (2 * i == bands && length > 0.0) {
            profile.push((r, z - 0.5 * length));
        }
    }
    lathe(&profile)
}

/// Turns a profile of (radius, height) from the top pole to the bottom pole about the z axis.
fn lathe(profile: &[(f64, f64)]) -> TriMesh {
    let rings = profile.len() - 2;
    let mut vertices = vec![Point3::new(0.0, 0.0, profile[0].1)];
    for &(r, z) in &profile[1..=rings] {
        vertices.extend((0..SIDES).map(|j| {
            let (sin, cos) = (TAU * j as f64 / SIDES as f64).sin_cos();
            Point3::new(r * cos, r * sin, z)
        }));
    }
    vertices.push(Point3::new(0.0, 0.0, profile[rings + 1].1));
    let at = |ring: usize, j: usize| (1 + ring * SIDES + j % SIDES) as u32;
    let bottom = vertices.len() as u32 - 1;
    let mut faces = Vec::with_capacity(2 * SIDES * rings);
    for j in 0..SIDES {
        faces.push([0, at(0, j), at(0, j + 1)]);
        faces.push([bottom, at(rings - 1, j + 1), at(rings - 1, j)]);
    }
    for ring in 1..rings {
        for j in 0..SIDES {
            let (a, b) = (at(ring - 1, j), at(ring - 1, j + 1));
            let (c, d) = (at(ring, j), at(ring, j + 1));
            faces.extend([[a, c, d], [a, d, b]]);
        }
    }
    TriMesh::new(vertices, faces)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ClosestPoints;
    use crate::closest::SignMethod;

    fn volume(mesh: &TriMesh) -> f64 {
        mesh.faces
            .iter()
            .map(|f| {
                let [a, b, c] = f.map(|v| mesh.vertices[v as usize].coords);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum()
    }

    #[test]
    fn every_primitive_is_closed_and_faces_outwards() {
        let (r, l) = (0.0157, 0.0236);
        let round = PI * r * r;
        for (mesh, expected, tolerance) in [
            (cuboid(&Vector3::new(0.1, 0.2, 0.3)), 0.006, 1e-15),
            (cylinder(r, l), round * l, 0.003),
            (sphere(r), round * r * 4.0 / 3.0, 0.008),
            (capsule(r, l), round * (l + r * 4.0 / 3.0), 0.008),
        ] {
            let tree = ClosestPoints::new(&mesh).unwrap();
            assert_eq!(tree.sign_method(), SignMethod::PseudoNormal);
            let v = volume(&mesh);
            assert!(v > 0.0 && (v / expected - 1.0).abs() < tolerance, "{v} {expected}");
        }
        assert_eq!(cuboid(&Vector3::new(1.0, 1.0, 1.0)).faces.len(), 12);
    }
}
