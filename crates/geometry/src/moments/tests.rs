use std::f64::consts::PI;

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_autodiff::Fwd;
use prehend_autodiff::check::finite_difference_jacobian;

use super::*;

/// Corners of a box and its triangles.
fn cuboid<S: Scalar>(half: [S; 3]) -> (Vec<Point3<S>>, Vec<[usize; 3]>) {
    let side = |i: usize, axis: usize| if i >> axis & 1 == 0 { -half[axis] } else { half[axis] };
    let corners = (0..8).map(|i| Point3::new(side(i, 0), side(i, 1), side(i, 2))).collect();
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    (corners, triangles)
}

/// Moments of the region of negative `distance`, by a sum over cells within `reach` of the origin.
fn counted(distance: impl Fn(&Vector3<f64>) -> f64, reach: f64) -> Moments {
    let cells = 160;
    let edge = 2.0 * reach / f64::from(cells);
    let place = |i: i32| (f64::from(i) + 0.5) * edge - reach;
    let mut sum = Moments::zero();
    for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
        for k in 0..cells {
            let x = Vector3::new(place(i), place(j), place(k));
            // The share of a cell on the surface that is inside.
            let share = (0.5 - distance(&x) / edge).clamp(0.0, 1.0) * edge.powi(3);
            sum = sum
                + Moments { volume: share, first: x * share, second: x * x.transpose() * share };
        }
    }
    sum
}

fn close(found: &Moments, expected: &Moments, tolerance: f64) {
    let size = expected.volume.cbrt();
    let off = [
        (found.volume - expected.volume).abs() / expected.volume,
        (found.first - expected.first).norm() / (expected.volume * size),
        (found.second - expected.second).norm() / expected.second.norm(),
    ];
    assert!(off.into_iter().all(|off| off < tolerance), "{off:?}\n{found:?}\n{expected:?}");
}

#[test]
fn closed_forms() {
    let (h, r) = (0.7, 0.4);
    let cylinder = Moments::cylinder(h, r);
    let volume = 2.0 * PI * r * r * h;
    let squares = Vector3::new(r * r / 4.0, h * h / 3.0, r * r / 4.0);
    close(&cylinder, &Moments::centered(volume, squares * volume), 1e-14);
    let cone = Moments::cone(h, r);
    let volume = volume / 3.0;
    let (mass, center, inertia) = cone.of_density(2.0);
    assert!((mass - 2.0 * volume).abs() < 1e-14 && (center.y + h / 2.0).abs() < 1e-14);
    assert!((inertia[(1, 1)] - 0.3 * mass * r * r).abs() < 1e-14);
    let across = mass * (3.0 / 20.0 * r * r + 3.0 / 80.0 * 4.0 * h * h);
    assert!((inertia[(0, 0)] - across).abs() < 1e-14);
    close(&Moments::capsule(0.0, r), &Moments::ball(r), 1e-14);
    close(&Moments::round_cone(0.0, 0.0, r), &Moments::ball(r), 1e-14);
    let half = [0.3, 0.5, 0.2];
    let (corners, triangles) = cuboid(half);
    let enclosed = Moments::enclosed(triangles.iter().map(|t| t.map(|i| corners[i])));
    close(&enclosed, &Moments::cuboid(&half.into()), 1e-14);
    close(&Moments::round_convex(&corners, &triangles, 0.0), &enclosed, 1e-14);
    // Steiner's formula.
    let border = 0.25;
    let [a, b, c] = half.map(|x| 2.0 * x);
    let round = Moments::round_convex(&corners, &triangles, border);
    let expected = a * b * c
        + 2.0 * (a * b + b * c + c * a) * border
        + PI * (a + b + c) * border * border
        + 4.0 / 3.0 * PI * border.powi(3);
    assert!((round.volume / expected - 1.0).abs() < 1e-14);
}

#[test]
fn round_solids_have_the_moments_of_their_matter() {
    let (h, r, border) = (0.4, 0.3, 0.2);
    let tube = |x: &Vector3<f64>| {
        let [out, up] = [x.x.hypot(x.z) - r, x.y.abs() - h];
        out.max(0.0).hypot(up.max(0.0)) + out.max(up).min(0.0) - border
    };
    close(&Moments::round_cylinder(h, r, border), &counted(tube, 0.65), 5e-4);
    let cone = |x: &Vector3<f64>| {
        let (out, up) = (x.x.hypot(x.z), x.y);
        // Of the triangle (0, −h), (r, −h), (0, h) in the half-plane.
        let [dr, dy] = [-r, 2.0 * h];
        let t = (((out - r) * dr + (up + h) * dy) / (dr * dr + dy * dy)).clamp(0.0, 1.0);
        let side = (out - r - t * dr).hypot(up + h - t * dy);
        let base = (out - out.min(r)).hypot(up + h);
        let inside = up > -h && (out - r) * dy - (up + h) * dr < 0.0;
        let distance = side.min(base);
        (if inside { -distance } else { distance }) - border
    };
    close(&Moments::round_cone(h, r, border), &counted(cone, 0.65), 5e-4);
    // A box that is turned and away from the origin.
    let half = [0.2, 0.3, 0.1];
    let motion = Isometry3::new(Vector3::new(0.05, -0.04, 0.08), Vector3::new(0.4, -0.3, 0.6));
    let (corners, triangles) = cuboid(half);
    let corners: Vec<_> = corners.iter().map(|p| motion * p).collect();
    let block = |x: &Vector3<f64>| {
        let beyond =
            motion.inverse_transform_point(&Point3::from(*x)).coords.abs() - Vector3::from(half);
        beyond.sup(&Vector3::zeros()).norm() + beyond.max().min(0.0) - border
    };
    let found = Moments::round_convex(&corners, &triangles, border);
    close(&found, &counted(block, 0.7), 5e-4);
    let (corners, triangles) = cuboid(half);
    close(&found, &Moments::round_convex(&corners, &triangles, border).moved(&motion), 1e-13);
}

#[test]
fn derivatives_match_differences() {
    fn all<S: Scalar>(x: &[S]) -> Vec<S> {
        let [a, b, c] = [x[0], x[1], x[2]];
        let (corners, triangles) = cuboid([a, b, c]);
        let turned = Isometry3::new(Vector3::new(a, b, -c), Vector3::new(c, a, b));
        let solids = [
            Moments::ball(a),
            Moments::cuboid(&Vector3::new(a, b, c)),
            Moments::capsule(a, b),
            Moments::round_cylinder(a, b, c),
            Moments::round_cone(a, b, c),
            Moments::round_convex(&corners, &triangles, b).moved(&turned),
        ];
        let numbers = |m: &Moments<S>| {
            let (mass, center, inertia) = m.of_density(c);
            let mut numbers = vec![mass, center.x, center.y, center.z];
            numbers.extend(inertia.iter());
            numbers
        };
        solids.iter().flat_map(numbers).collect()
    }
    let at = [0.3, 0.2, 0.4];
    let exact = all(&Fwd::<3>::variables(at));
    let differences = finite_difference_jacobian(all, &at, 1e-5);
    for (exact, row) in exact.iter().zip(&differences) {
        for (a, b) in exact.derivative.iter().zip(row) {
            assert!((a - b).abs() < 1e-8, "{exact:?} {row:?}");
        }
    }
}
