//! Tubes along a path: rods, wires and hooks.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Point3, UnitQuaternion, Vector3};

use crate::mesh::TriMesh;

/// The points within `radius` \[m\] of `path` \[m\], in `segments` columns (at least three), with a hemisphere of `rows` rows (at
/// least one) at each end.
///
/// Points that repeat the one before count once, and the path should bend by less than the radius: a row of vertices lies across each
/// of its points, turned from the last one without a twist. Fewer than two different points give an empty mesh.
pub fn tube(path: &[Point3<f64>], radius: f64, segments: usize, rows: usize) -> TriMesh {
    let (segments, rows) = (segments.max(3), rows.max(1));
    let mut path = path.to_vec();
    path.dedup_by(|next, last| (*next - *last).norm() == 0.0);
    let sides: Vec<Vector3<f64>> = path.windows(2).map(|p| (p[1] - p[0]).normalize()).collect();
    let (Some(first), Some(last)) = (sides.first(), sides.last()) else {
        return TriMesh::default();
    };
    // Across the first side, along the axis that it has least of.
    let mut across = first.cross(&Vector3::ith(first.iamin(), 1.0)).normalize();
    let mut along = *first;
    let mut mesh = TriMesh::new(vec![path[0] - first * radius], Vec::new());
    let mut ring = |center: Point3<f64>, tangent: &Vector3<f64>, radius: f64| {
        if let Some(turn) = UnitQuaternion::rotation_between(&along, tangent) {
            across = turn * across;
        }
        along = *tangent;
        let other = tangent.cross(&across);
        let place = |j: usize| {
            let (sin, cos) = (TAU * j as f64 / segments as f64).sin_cos();
            center + (across * cos + other * sin) * radius
        };
        mesh.vertices.extend((0..segments).map(place));
    };
    for row in 1..rows {
        let (sin, cos) = (FRAC_PI_2 * row as f64 / rows as f64).sin_cos();
        ring(path[0] - first * (radius * cos), first, radius * sin);
    }
    for (i, &center) in path.iter().enumerate() {
        let [before, after] = [i.saturating_sub(1), i.min(sides.len() - 1)].map(|k| sides[k]);
        // Where the path turns back there is no direction between.
        ring(center, &(before + after).try_normalize(0.0).unwrap_or(after), radius);
    }
    for row in (1..rows).rev() {
        let (sin, cos) = (FRAC_PI_2 * row as f64 / rows as f64).sin_cos();
        ring(path[path.len() - 1] + last * (radius * cos), last, radius * sin);
    }
    let end = mesh.vertices.len();
    mesh.vertices.push(path[path.len() - 1] + last * radius);
    let rings = (end - 1) / segments;
    let at = |ring: usize, j: usize| (1 + ring * segments + j % segments) as u32;
    for j in 0..segments {
        mesh.faces.push([0, at(0, j + 1), at(0, j)]);
        for ring in 1..rings {
            let [a, b, c, d] = [at(ring - 1, j), at(ring - 1, j + 1), at(ring, j + 1), at(ring, j)];
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
        mesh.faces.push([end as u32, at(rings - 1, j), at(rings - 1, j + 1)]);
    }
    mesh
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::shapes::closed::closed_volume;

    #[test]
    fn a_straight_tube_is_a_capsule_and_a_bent_one_has_its_volume() {
        let radius = 0.01;
        let straight = [Point3::new(0.0, 0.1, 0.0), Point3::new(0.1, 0.1, 0.0)];
        let ball = 4.0 / 3.0 * PI * radius * radius * radius;
        let exact = ball + PI * radius * radius * 0.1;
        let errors = [16, 32, 64].map(|segments| {
            let mesh = tube(&straight, radius, segments, segments / 4);
            (closed_volume(&mesh) / exact - 1.0).abs()
        });
        assert!(errors.windows(2).all(|e| e[1] < 0.3 * e[0]) && errors[2] < 5e-3, "{errors:?}");
        // Pappus: half a circle, and what is left of a plane one.
        let bend = |i: usize| {
            let (sin, cos) = (PI * i as f64 / 64.0).sin_cos();
            Point3::new(0.05 * cos, 0.05 * sin, 0.02 * i as f64 / 64.0)
        };
        let path: Vec<_> = (0..=64).map(bend).collect();
        let length: f64 = path.windows(2).map(|p| (p[1] - p[0]).norm()).sum();
        let volume = closed_volume(&tube(&path, radius, 64, 16));
        assert!((volume / (ball + PI * radius * radius * length) - 1.0).abs() < 5e-3);
    }

    #[test]
    fn no_path_is_no_tube() {
        assert!(tube(&[], 0.1, 8, 2).faces.is_empty());
        assert!(tube(&[Point3::origin()], 0.1, 8, 2).vertices.is_empty());
    }
}
