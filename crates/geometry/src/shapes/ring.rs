//! Bodies around the z axis that leave the axis free.

use std::f64::consts::TAU;

use nalgebra::Point3;

use crate::mesh::TriMesh;

/// The surface swept by turning the closed `profile`, pairs (radius, z) \[m\] counter-clockwise with the radius to
/// the right, around z in `segments` columns (at least three), the first at +x.
///
/// Every radius must be positive, and the profile must not cross itself; fewer than three pairs give an empty
/// mesh. Texture coordinates unroll the surface: u runs around z from +x, v is the fraction of the profile's length.
pub fn revolve_ring(profile: &[[f64; 2]], segments: usize) -> TriMesh {
    let rows = profile.len();
    if rows < 3 {
        return TriMesh::default();
    }
    let (columns, stride) = (segments.max(3), rows + 1);
    let at = |i: usize| profile[i % rows];
    let mut lengths = vec![0.0];
    for i in 0..rows {
        let ([r0, z0], [r1, z1]) = (at(i), at(i + 1));
        lengths.push(lengths[i] + (r1 - r0).hypot(z1 - z0));
    }
    let (mut mesh, mut uvs) = (TriMesh::default(), Vec::new());
    for j in 0..=columns {
        // The last column is the first one again, to the bit, for the seam to weld.
        let (sin, cos) = (TAU * (j % columns) as f64 / columns as f64).sin_cos();
        for (i, length) in lengths.iter().enumerate() {
            let [r, z] = at(i);
            mesh.vertices.push(Point3::new(r * cos, r * sin, z));
            uvs.push([
                j as f32 / columns as f32,
                (length / lengths[rows].max(f64::MIN_POSITIVE)) as f32,
            ]);
        }
    }
    for j in 0..columns {
        for i in 0..rows {
            let a = (j * stride + i) as u32;
            let b = a + stride as u32;
            mesh.faces.push([a, b, b + 1]);
            mesh.faces.push([a, b + 1, a + 1]);
        }
    }
    mesh.uvs = Some(uvs);
    mesh
}

/// A ring about z: the points within `minor` \[m\] of the circle of radius `major` \[m\] (larger than `minor`), in
/// `segments` columns and `rows` rows (at least three each); its vertices lie on the true surface.
pub fn torus(major: f64, minor: f64, segments: usize, rows: usize) -> TriMesh {
    let rows = rows.max(3);
    let circle: Vec<_> = (0..rows)
        .map(|i| {
            let (sin, cos) = (TAU * i as f64 / rows as f64).sin_cos();
            [major + minor * cos, minor * sin]
        })
        .collect();
    revolve_ring(&circle, segments)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::closed::closed_volume_of_genus;
    use std::f64::consts::PI;

    #[test]
    fn torus_volume_converges_to_the_closed_form() {
        let (major, minor) = (0.05, 0.02);
        let exact = 2.0 * PI * PI * major * minor * minor;
        let errors = [16, 32, 64, 128]
            .map(|n| (closed_volume_of_genus(&torus(major, minor, n, n), 1) / exact - 1.0).abs());
        assert!(errors.windows(2).all(|e| e[1] < 0.3 * e[0]) && errors[3] < 2e-3, "{errors:?}");
        for p in &torus(major, minor, 24, 12).vertices {
            let distance = (p.x.hypot(p.y) - major).hypot(p.z);
            assert!((distance - minor).abs() < 1e-15);
        }
    }

    #[test]
    fn a_square_tube_has_the_volume_of_its_prism() {
        // The prism over a regular polygon with a hole: exact at any resolution.
        let tube = revolve_ring(&[[0.03, 0.0], [0.05, 0.0], [0.05, 0.1], [0.03, 0.1]], 7);
        let polygon = 3.5 * (TAU / 7.0).sin();
        let exact = polygon * (0.05_f64.powi(2) - 0.03_f64.powi(2)) * 0.1;
        assert!((closed_volume_of_genus(&tube, 1) / exact - 1.0).abs() < 1e-12);
        assert!(revolve_ring(&[[1.0, 0.0], [1.0, 1.0]], 8).faces.is_empty());
    }
}
