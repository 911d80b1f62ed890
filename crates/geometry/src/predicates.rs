//! On which side things lie, decided exactly, with one of two bodies moved by an infinitesimal translation.
//!
//! Every question about two bodies A and B is the sign of a product (u × v)·w of differences of vertices. A filter in
//! floating point answers most; where rounding might have decided, exact arithmetic does. Where the product is
//! zero, B is taken to be moved by (ε, ε², ε³) for an ε smaller than anything (Edelsbrunner and Mücke,
//! "Simulation of simplicity", 1990, with a translation in place of independent motions): the sign is then that of
//! the first component of u × v that is not zero. This is one true motion of a rigid body, so the answers never contradict
//! each other; and volumes are continuous, so the motion does not show in them.

use nalgebra::{Point3, Vector3};

use crate::expansion::{Expansion, difference};

/// The difference of the second point and the first.
pub(super) type Arrow<'a> = [&'a Point3<f64>; 2];

/// Above this part of its terms' magnitudes, a triple product of rounded differences has the right sign; the bound is
/// 7.8e-16 (Shewchuk 1997, `o3derrboundA`); ten times that also keeps the value right to a tenth.
const FILTER: f64 = 1e-14;

/// A product (u × v)·w and its sign after the infinitesimal motion, 0 only where that leaves it zero.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    pub(super) value: f64,
    pub(super) sign: i8,
}

/// A triangle prepared for asking on which side of it points lie.
pub(super) struct Plane<'a> {
    corners: [&'a Point3<f64>; 3],
    normal: Vector3<f64>,
    /// Sum of the absolute terms of each component of `normal`: bounds its error.
    bound: Vector3<f64>,
    /// How the points asked about move relative to the triangle: along or against the infinitesimal motion.
    motion: i8,
}

impl<'a> Plane<'a> {
    /// The triangle of A where `of_a`, else of B; points are of the other body.
    pub(super) fn new(corners: [&'a Point3<f64>; 3], of_a: bool) -> Self {
        let (u, v) = (corners[1] - corners[0], corners[2] - corners[0]);
        let bound = absolute_cross(&u, &v);
        Self { corners, normal: u.cross(&v), bound, motion: if of_a { 1 } else { -1 } }
    }

    /// Six times the volume under the triangle, positive where it looks towards `point`.
    #[inline]
    pub(super) fn side(&self, point: &Point3<f64>) -> Side {
        let w = point - self.corners[0];
        let value = self.normal.dot(&w);
        if value.abs() > FILTER * self.bound.dot(&w.abs()) {
            return Side { value, sign: sign(value) };
        }
        let [a, b, c] = self.corners;
        let value = exact_triple([a, b], [a, c], [a, point]);
        let sign = match sign(value) {
            0 => self.motion * self.leaning(),
            s => s,
        };
        Side { value, sign }
    }

    /// The sign of the first component of the normal that is not zero.
    fn leaning(&self) -> i8 {
        let [a, b, c] = self.corners;
        leading_sign([a, b], [a, c])
    }

    /// How the surface crosses the ray from `point` along x: 1 outward, −1 inward, 0 not at all.
    pub(super) fn along_x(&self, point: &Point3<f64>) -> i32 {
        let side_of = |k: usize| {
            let (from, to) = (self.corners[k], self.corners[(k + 1) % 3]);
            match minor([from, to], [from, point], 0) {
                // The motion seen along x is (ε², ε³).
                0 if to.z != from.z => -self.motion * sign(to.z - from.z),
                0 => self.motion * sign(to.y - from.y),
                s => s,
            }
        };
        let outward = side_of(0);
        let pierced = outward != 0 && side_of(1) == outward && side_of(2) == outward;
        if pierced && self.side(point).sign == -outward { i32::from(outward) } else { 0 }
    }
}

/// Sign of (a × b)·(from the start of `a` to the start of `b`), `a` an edge of A and `b` one of B.
#[inline]
pub(super) fn edges_turn(a: Arrow<'_>, b: Arrow<'_>) -> i8 {
    let (u, v, w) = (a[1] - a[0], b[1] - b[0], b[0] - a[0]);
    let value = u.cross(&v).dot(&w);
    if value.abs() > FILTER * absolute_cross(&u, &v).dot(&w.abs()) {
        return sign(value);
    }
    match sign(exact_triple(a, b, [a[0], b[0]])) {
        0 => leading_sign(a, b),
        s => s,
    }
}

fn absolute_cross(u: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    let (u, v) = (u.abs(), v.abs());
    Vector3::new(u.y * v.z + u.z * v.y, u.z * v.x + u.x * v.z, u.x * v.y + u.y * v.x)
}

fn sign(value: f64) -> i8 {
    i8::from(value > 0.0) - i8::from(value < 0.0)
}

/// The difference along axis `k`.
fn along(arrow: Arrow<'_>, k: usize) -> Expansion<2> {
    difference(arrow[1][k], arrow[0][k])
}

/// Component `k` of u × v.
fn exact_minor(u: Arrow<'_>, v: Arrow<'_>, k: usize) -> Expansion<16> {
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    let first: Expansion<8> = along(u, i).times::<4, 8>(&along(v, j));
    let second: Expansion<8> = along(u, j).times::<4, 8>(&along(v, i));
    first.plus(&second.negated())
}

/// Sign of component `k` of u × v.
fn minor(u: Arrow<'_>, v: Arrow<'_>, k: usize) -> i8 {
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    let d = |arrow: Arrow<'_>, k: usize| arrow[1][k] - arrow[0][k];
    let (first, second) = (d(u, i) * d(v, j), d(u, j) * d(v, i));
    if (first - second).abs() > FILTER * (first.abs() + second.abs()) {
        return sign(first - second);
    }
    sign(exact_minor(u, v, k).value())
}

fn leading_sign(u: Arrow<'_>, v: Arrow<'_>) -> i8 {
    (0..3).map(|k| minor(u, v, k)).find(|s| *s != 0).unwrap_or(0)
}

/// (u × v)·w, rounded once it is known.
#[cold]
fn exact_triple(u: Arrow<'_>, v: Arrow<'_>, w: Arrow<'_>) -> f64 {
    // The same or no vector: what bodies that share vertices ask most.
    let difference = |arrow: Arrow<'_>| arrow[1] - arrow[0];
    if w[0] == w[1] || (w[0] == u[0] && w[1] == u[1]) || (w[0] == v[0] && w[1] == v[1]) {
        return 0.0;
    }
    let w_rounded = difference(w);
    let term = |k: usize| -> Expansion<64> {
        if w_rounded[k] == 0.0 {
            // A difference of doubles is rounded to zero only where it is zero.
            return Expansion::ZERO;
        }
        exact_minor(u, v, k).times::<32, 64>(&along(w, k))
    };
    let two: Expansion<128> = term(0).plus(&term(1));
    let all: Expansion<192> = two.plus(&term(2));
    all.value()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    /// Triple product (u × v)·w of points with integer coordinates.
    fn integer_triple(u: Arrow<'_>, v: Arrow<'_>, w: Arrow<'_>) -> i128 {
        let d = |a: Arrow<'_>| [0, 1, 2].map(|k| a[1][k] as i128 - a[0][k] as i128);
        let (u, v, w) = (d(u), d(v), d(w));
        (0..3)
            .map(|k| {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                (u[i] * v[j] - u[j] * v[i]) * w[k]
            })
            .sum()
    }

    #[test]
    fn signs_are_those_of_integers_where_rounding_decides() {
        let mut random = SplitMix64::new(2);
        let mut decided = [0; 3];
        for _ in 0..3000 {
            let mut integer = |bits: i32| ((random.uniform() - 0.5) * 2f64.powi(bits)).round();
            // Points of a plane through the first, nudged by nothing or one unit.
            let mut vector = |bits: i32| Vector3::from_fn(|_, _| integer(bits));
            let (a, u, v) = (Point3::from(vector(30)), vector(20), vector(20));
            let at = |i: f64, j: f64| a + u * i + v * j;
            let weights = vector(8);
            let mut p = [at(0.0, 0.0), at(1.0, 0.0), at(weights.z, 1.0), at(weights.x, weights.y)];
            p[3] += vector(1);
            let exact = integer_triple([&p[0], &p[1]], [&p[0], &p[2]], [&p[0], &p[3]]);
            let side = Plane::new([&p[0], &p[1], &p[2]], true).side(&p[3]);
            let error = (side.value - exact as f64).abs();
            assert!(error <= 0.3 * (exact as f64).abs(), "{} {exact}", side.value);
            if exact != 0 {
                assert_eq!(i128::from(side.sign), exact.signum());
            }
            decided[(exact.signum() + 1) as usize] += 1;
            // Four points on an edge pair: the same determinant.
            let exact = integer_triple([&p[0], &p[1]], [&p[2], &p[3]], [&p[0], &p[2]]);
            let turn = edges_turn([&p[0], &p[1]], [&p[2], &p[3]]);
            assert!(exact == 0 || i128::from(turn) == exact.signum());
        }
        assert!(decided.iter().all(|n| *n > 100), "{decided:?}");
    }

    #[test]
    fn ties_are_broken_by_one_motion() {
        // In units so fine that the motion (ε, ε², ε³) can be carried out: bodies in a corner of the grid.
        let motion = Vector3::new(2f64.powi(-12), 2f64.powi(-24), 2f64.powi(-36));
        let mut random = SplitMix64::new(3);
        for _ in 0..5000 {
            let mut point =
                || Point3::from(Vector3::from_fn(|_, _| (3.0 * random.uniform()).floor()));
            let p: [Point3<f64>; 4] = std::array::from_fn(|_| point());
            let [a, b, c, d] = &p;
            let moved = d + motion;
            let side = |of_a, q: &Point3<f64>| Plane::new([a, b, c], of_a).side(q).sign;
            assert_eq!(side(true, d), side(true, &moved));
            assert_eq!(side(false, d), side(false, &(d - motion)));
            let (from, to) = (c + motion, d + motion);
            assert_eq!(edges_turn([a, b], [c, d]), edges_turn([a, b], [&from, &to]));
            // Turned round, an edge is passed on the other side.
            assert_eq!(edges_turn([a, b], [c, d]), -edges_turn([b, a], [c, d]));
            assert_eq!(edges_turn([a, b], [c, d]), -edges_turn([a, b], [d, c]));
            let plane = |of_a| Plane::new([a, b, c], of_a);
            assert_eq!(plane(true).along_x(d), plane(true).along_x(&moved));
            assert_eq!(plane(false).along_x(d), plane(false).along_x(&(d - motion)));
        }
    }
}
