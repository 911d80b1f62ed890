//! Prisms over plane outlines.

use nalgebra::{Point2, Point3};

use crate::mesh::TriMesh;

/// Why an outline bounds no face.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum OutlineError {
    /// Fewer than three points, or three on a line.
    #[error("an outline of {points} points encloses no area")]
    NoArea {
        /// Points given.
        points: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("point {point} of the outline is not finite")]
    Coordinate {
        /// The point.
        point: usize,
    },
    /// The outline meets itself.
    #[error("the sides from point {first} and from point {second} of the outline meet")]
    Crossing {
        /// The point at which the first of the sides begins.
        first: usize,
        /// The same of the second.
        second: usize,
    },
    /// The two heights are not in order.
    #[error("cannot extrude from z = {from} m to {to} m")]
    Heights {
        /// The lower end \[m\].
        from: f64,
        /// The upper end \[m\].
        to: f64,
    },
}

/// The prism over the closed `outline`, points (x, y) \[m\] in either direction, between the two `heights` \[m\].
///
/// The outline may be concave, but not touch itself. Each cap has two triangles fewer than the outline has points.
///
/// # Errors
/// [`OutlineError`] for an outline that is not finite, encloses nothing or meets itself, and heights out of order.
pub fn extrude(outline: &[[f64; 2]], heights: [f64; 2]) -> Result<TriMesh, OutlineError> {
    let [from, to] = heights;
    if !(from < to && from.is_finite() && to.is_finite()) {
        return Err(OutlineError::Heights { from, to });
    }
    let points: Vec<Point2<f64>> = outline.iter().map(|p| Point2::from(*p)).collect();
    let count = points.len();
    if let Some(point) = points.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        return Err(OutlineError::Coordinate { point });
    }
    let area: f64 =
        (1..count.max(2) - 1).map(|i| turn(&points[0], &points[i], &points[i + 1])).sum();
    if count < 3 || area == 0.0 {
        return Err(OutlineError::NoArea { points: count });
    }
    if let Some((first, second)) = crossing(&points) {
        return Err(OutlineError::Crossing { first, second });
    }
    let ring: Vec<usize> =
        if area > 0.0 { (0..count).collect() } else { (0..count).rev().collect() };
    let mut mesh = TriMesh::default();
    for z in heights {
        mesh.vertices.extend(points.iter().map(|p| Point3::new(p.x, p.y, z)));
    }
    let corner = |i: usize, top: bool| (i + if top { count } else { 0 }) as u32;
    for [a, b, c] in triangulate(&points, ring.clone()) {
        mesh.faces.push([corner(a, false), corner(c, false), corner(b, false)]);
        mesh.faces.push([corner(a, true), corner(b, true), corner(c, true)]);
    }
    for (k, &a) in ring.iter().enumerate() {
        let b = ring[(k + 1) % count];
        mesh.faces.push([corner(a, false), corner(b, false), corner(b, true)]);
        mesh.faces.push([corner(a, false), corner(b, true), corner(a, true)]);
    }
    Ok(mesh)
}

/// Twice the area of the triangle, positive if it turns to the left.
fn turn(a: &Point2<f64>, b: &Point2<f64>, c: &Point2<f64>) -> f64 {
    (b - a).perp(&(c - a))
}

/// Two sides that share more than the point that joins them.
fn crossing(points: &[Point2<f64>]) -> Option<(usize, usize)> {
    let n = points.len();
    let side = |i: usize| (&points[i], &points[(i + 1) % n]);
    let between = |a: &Point2<f64>, b: &Point2<f64>, p: &Point2<f64>| {
        turn(a, b, p) == 0.0 && (p - a).dot(&(p - b)) <= 0.0
    };
    let meet = |i: usize, j: usize| {
        let ((a, b), (c, d)) = (side(i), side(j));
        if (i + 1) % n == j {
            // Neighbors: one of the outer ends on the other side, or no length at all.
            return a == b || c == d || between(a, b, d) || between(c, d, a);
        }
        let touch = between(a, b, c) || between(a, b, d) || between(c, d, a) || between(c, d, b);
        let straddle = turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0;
        touch || straddle
    };
    let pairs = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    pairs
        .filter(|&(i, j)| (i + 1) % n == j || (j > i && (j + 1) % n != i))
        .find(|&(i, j)| meet(i, j))
}

/// Cuts a counter-clockwise polygon into triangles, ear by ear, the roundest first (Meisters, "Polygons have ears",
/// American Mathematical Monthly 82, 1975).
fn triangulate(points: &[Point2<f64>], mut ring: Vec<usize>) -> Vec<[usize; 3]> {
    let mut triangles = Vec::with_capacity(ring.len() - 2);
    while ring.len() > 3 {
        let n = ring.len();
        let corner = |k: usize| [ring[(k + n - 1) % n], ring[k], ring[(k + 1) % n]];
        let roundness = |k: usize| {
            let [a, b, c] = corner(k).map(|i| &points[i]);
            let free = turn(a, b, c) > 0.0
                && ring.iter().filter(|i| !corner(k).contains(i)).all(|&i| {
                    let p = &points[i];
                    turn(a, b, p) < 0.0 || turn(b, c, p) < 0.0 || turn(c, a, p) < 0.0
                });
            let sides = (b - a).norm_squared() + (c - b).norm_squared() + (a - c).norm_squared();
            if free { turn(a, b, c) / sides } else { -1.0 }
        };
        let best = (0..n)
            .map(|k| (k, roundness(k)))
            .fold((0, -2.0), |best, ear| if ear.1 > best.1 { ear } else { best });
        triangles.push(corner(best.0));
        ring.remove(best.0);
    }
    triangles.extend(<[usize; 3]>::try_from(ring));
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::closed::closed_volume;
    use std::f64::consts::TAU;

    /// A star of `n` points, turned by `phase`: as concave as can be.
    fn star(n: usize, phase: f64) -> Vec<[f64; 2]> {
        (0..2 * n)
            .map(|i| {
                let radius = if i % 2 == 0 { 0.05 } else { 0.01 };
                let (s, c) = (TAU * i as f64 / (2 * n) as f64 + phase).sin_cos();
                [radius * c + 0.1, radius * s - 0.2]
            })
            .collect()
    }

    #[test]
    fn prisms_have_the_volume_of_their_outline() {
        for n in 2..30 {
            let mut outline = star(n, 0.3 * n as f64);
            let area = n as f64 * 0.05 * 0.01 * (TAU / (2 * n) as f64).sin();
            for _ in 0..2 {
                let mesh = extrude(&outline, [-0.1, 0.3]).unwrap();
                assert_eq!(mesh.faces.len(), 2 * (2 * n - 2) + 4 * n);
                assert!((closed_volume(&mesh) / (0.4 * area) - 1.0).abs() < 1e-12, "{n}");
                // Cap triangles do not overlap: their areas sum to the outline's.
                let caps: f64 = (0..mesh.faces.len())
                    .filter(|&f| mesh.triangle(f).iter().all(|p| p.z == 0.3))
                    .map(|f| 0.5 * mesh.area_vector(f).norm())
                    .sum();
                assert!((caps / area - 1.0).abs() < 1e-12, "{n}");
                outline.reverse();
            }
        }
    }

    #[test]
    fn points_on_straight_sides_stay_on_the_rim() {
        let outline =
            [[0., 0.], [1., 0.], [2., 0.], [2., 1.], [2., 2.], [1., 2.], [0., 2.], [0., 1.]];
        let mesh = extrude(&outline, [0.0, 1.0]).unwrap();
        assert!((closed_volume(&mesh) - 4.0).abs() < 1e-12);
        assert!((0..mesh.faces.len()).all(|f| mesh.area_vector(f).norm() > 0.1));
    }

    #[test]
    fn outlines_that_bound_nothing_are_errors() {
        let error = |outline: &[[f64; 2]]| extrude(outline, [0.0, 1.0]).unwrap_err();
        assert_eq!(error(&[]), OutlineError::NoArea { points: 0 });
        assert_eq!(error(&[[0., 0.], [1., 0.]]), OutlineError::NoArea { points: 2 });
        assert_eq!(error(&[[0., 0.], [1., 0.], [2., 0.]]), OutlineError::NoArea { points: 3 });
        assert_eq!(
            error(&[[0., 0.], [1., f64::NAN], [2., 0.]]),
            OutlineError::Coordinate { point: 1 }
        );
        let bow = [[0., 0.], [3., 0.], [0., 1.], [1., 2.]];
        assert_eq!(error(&bow), OutlineError::Crossing { first: 1, second: 3 });
        let pinched = [[0., 0.], [2., 0.], [2., 2.], [1., 0.], [0., 2.]];
        assert!(matches!(error(&pinched), OutlineError::Crossing { .. }));
        let twice = [[0., 0.], [1., 0.], [1., 0.], [1., 1.]];
        assert!(matches!(error(&twice), OutlineError::Crossing { .. }));
        let back = [[0., 0.], [2., 0.], [1., 0.], [1., 1.]];
        assert!(matches!(error(&back), OutlineError::Crossing { .. }));
        let square = [[0., 0.], [1., 0.], [1., 1.], [0., 1.]];
        assert!(matches!(extrude(&square, [1.0, 1.0]), Err(OutlineError::Heights { .. })));
        assert!(matches!(extrude(&square, [0.0, f64::NAN]), Err(OutlineError::Heights { .. })));
    }
}
