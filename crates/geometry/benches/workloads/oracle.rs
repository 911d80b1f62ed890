//! Distance and sign by looking at every face: slow, and with nothing in common with what it checks.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};
use prehend_geometry::TriMesh;

/// Distance from `point` to the surface \[m\].
pub(crate) fn distance(mesh: &TriMesh, point: &Point3<f64>) -> f64 {
    let to_face = |face| to_triangle(mesh.triangle(face).map(|corner| corner - point));
    (0..mesh.faces.len()).map(to_face).fold(f64::INFINITY, f64::min)
}

/// Distance \[m\], negative where the surface winds around `point`.
pub(crate) fn signed_distance(mesh: &TriMesh, point: &Point3<f64>) -> f64 {
    // Half the solid angle of each face: van Oosterom and Strackee, 1983.
    let angle = |face| {
        let [a, b, c] = mesh.triangle(face).map(|corner| corner - point);
        let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
        let along = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
        f64::atan2(a.dot(&b.cross(&c)), along)
    };
    let windings: f64 = (0..mesh.faces.len()).map(angle).sum::<f64>() / TAU;
    if windings > 0.5 { -distance(mesh, point) } else { distance(mesh, point) }
}

/// True answers at about `count` entries, spread evenly over `points`.
pub(crate) fn truth(
    points: &[Point3<f64>],
    count: usize,
    answer: impl Fn(&Point3<f64>) -> f64,
) -> Vec<(usize, f64)> {
    let step = (points.len() / count).max(1);
    (0..points.len()).step_by(step).map(|i| (i, answer(&points[i]))).collect()
}

/// Distance from the origin to a triangle.
fn to_triangle(corners: [Vector3<f64>; 3]) -> f64 {
    let [a, b, c] = corners;
    let normal = (b - a).cross(&(c - a));
    let sides = [(a, b), (b, c), (c, a)];
    if sides.iter().all(|(from, to)| (to - from).cross(from).dot(&normal) <= 0.0) {
        // The foot in the plane lies on the inner side of every edge.
        return a.dot(&normal).abs() / normal.norm();
    }
    let to_side = |(from, to): (Vector3<f64>, Vector3<f64>)| {
        let side = to - from;
        let along = (-from.dot(&side) / side.norm_squared()).clamp(0.0, 1.0);
        (from + side * along).norm()
    };
    sides.map(to_side).into_iter().fold(f64::INFINITY, f64::min)
}
