//! On which side things lie, decided exactly, with one of two bodies moved by an infinitesimal translation.
//!
//! Every question about two bodies A and B is the sign of a product (u × v)·w of differences of vertices. A filter in
//! floating point answers most; where rounding might have decided, exact arithmetic does. Where the product is
//! zero, B is taken to be moved by (ε, ε², ε³) for an ε smaller than anything (Edelsbrunner and Mücke,
//! "Simulation of simplicity", 1990, with a translation in place of independent motions): the sign is then that of
//! the first component of u × v that is not zero. This is one true motion of a rigid body, so the answers never contradict
//! each other; and volumes are continuous, so the motion does not show in them.

use nalgebra::{Point3, Vector3};

use super::expansion::{Expansion, difference};

/// The difference of the second point and the first.
pub(super) type Arrow<'a> = [&'a Point3<f64>; 2];

/// Above this part of its terms' magnitudes, a triple product of rounded differences has the right sign; the bound is
/// 7.8e-16 (Shewchuk 1997, `o3derrboundA`).
const FILTER: f64 = 1e-15;

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
    /// What `normal` would be had its terms not cancelled: bounds its error.
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
