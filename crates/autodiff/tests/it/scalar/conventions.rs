//! Slopes where there is no derivative, or only one from one side.

use std::f64::consts::{FRAC_PI_2, LN_2, PI};

use nalgebra::{ComplexField, Vector3};
use prehend_autodiff::{Fwd, Recording, Scalar, Var};

use super::table::cases;
use super::{forward, reverse};

const INF: f64 = f64::INFINITY;
const NAN: f64 = f64::NAN;

/// A text of the table, the operands, the value and the two slopes.
#[rustfmt::skip]
const CONVENTIONS: &[(&str, [f64; 2], f64, [f64; 2])] = &[
    // A magnitude is flat at zero.
    ("ComplexField::abs(x) * y", [0.0, 1.0], 0.0, [0.0, 0.0]),
    ("ComplexField::abs(x) * y", [-0.0, 1.0], 0.0, [0.0, 0.0]),
    ("Signed::abs(&x) * y", [-0.0, 1.0], 0.0, [0.0, 0.0]),
    ("x.modulus() * y", [-0.0, 1.0], 0.0, [0.0, 0.0]),
    ("x.norm1() * y", [0.0, 1.0], 0.0, [0.0, 0.0]),
    ("x.to_polar().0 * y + x.to_polar().1", [0.0, 2.0], 0.0, [0.0, 0.0]),
    ("x.to_exp().0 * y + x.to_exp().1", [0.0, 2.0], 1.0, [0.0, 0.0]),
    ("x.copysign(y)", [0.0, 1.0], 0.0, [0.0, 0.0]),
    ("x.copysign(y)", [-0.0, 1.0], 0.0, [0.0, 0.0]),
    ("x.copysign(y)", [0.0, -1.0], -0.0, [0.0, 0.0]),
    ("x.copysign(y)", [-0.0, -0.0], -0.0, [0.0, 0.0]),
    ("x.copysign(y)", [2.0, -0.0], -2.0, [-1.0, 0.0]),
    ("x.hypot(y)", [0.0, -0.0], 0.0, [0.0, 0.0]),
    ("x.hypot(y)", [-0.0, -3.0], 3.0, [0.0, -1.0]),
    // A sign does not move.
    ("ComplexField::signum(x) * y", [0.0, 2.0], 2.0, [0.0, 1.0]),
    ("ComplexField::signum(x) * y", [-0.0, 2.0], -2.0, [0.0, -1.0]),
    ("x.argument() * y", [-0.0, 2.0], 0.0, [0.0, 0.0]),
    ("x.argument() * y", [-1.0, 1.0], PI, [0.0, PI]),
    // The first operand wins a tie, and a number beats a NaN.
    ("x.max(y)", [2.0, 2.0], 2.0, [1.0, 0.0]),
    ("x.min(y)", [2.0, 2.0], 2.0, [1.0, 0.0]),
    ("x.max(y)", [NAN, 2.0], 2.0, [0.0, 1.0]),
    ("x.min(y)", [2.0, NAN], 2.0, [1.0, 0.0]),
    ("x.clamp(y, y + S::one())", [2.0, 2.0], 2.0, [1.0, 0.0]),
    ("x.clamp(y, y + S::one())", [3.0, 2.0], 3.0, [1.0, 0.0]),
    ("y.clamp(x, S::constant(3.0))", [3.0, 3.0], 3.0, [0.0, 1.0]),
    ("x.abs_sub(&y)", [2.0, 2.0], 0.0, [0.0, 0.0]),
    // Rounding is flat; what it takes off is not. The remainder counts multiples as its value does.
    ("x.floor() * y", [2.0, 1.0], 2.0, [0.0, 2.0]),
    ("x.ceil() * y", [2.0, 1.0], 2.0, [0.0, 2.0]),
    ("x.round() * y", [2.5, 1.0], 3.0, [0.0, 3.0]),
    ("x.trunc() * y", [-2.0, 1.0], -2.0, [0.0, -2.0]),
    ("x.fract() * y", [2.0, 1.0], 0.0, [1.0, 0.0]),
    ("x % y", [6.0, 3.0], 0.0, [1.0, -2.0]),
    ("x % y", [-6.0, 3.0], -0.0, [1.0, 2.0]),
    ("x % y", [0.0, 3.0], 0.0, [1.0, 0.0]),
    ("x % y", [6.0, 0.0], NAN, [1.0, NAN]),
    // At the edge of its domain a function is as steep as from the inside.
    ("x.sqrt()", [0.0, 0.5], 0.0, [INF, 0.0]),
    ("x.sqrt()", [-0.0, 0.5], -0.0, [INF, 0.0]),
    ("x.try_sqrt().unwrap_or(y)", [-0.0, 0.5], -0.0, [INF, 0.0]),
    ("x.try_sqrt().unwrap_or(y)", [-1.0, 0.5], 0.5, [0.0, 1.0]),
    ("x.cbrt()", [-0.0, 0.5], -0.0, [INF, 0.0]),
    ("x.asin()", [1.0, 0.5], FRAC_PI_2, [INF, 0.0]),
    ("x.asin()", [-1.0, 0.5], -FRAC_PI_2, [INF, 0.0]),
    ("x.acos()", [1.0, 0.5], 0.0, [-INF, 0.0]),
    ("x.acos()", [-1.0, 0.5], PI, [-INF, 0.0]),
    ("x.acosh()", [1.0, 0.5], 0.0, [INF, 0.0]),
    ("x.atanh()", [1.0, 0.5], INF, [INF, 0.0]),
    ("x.atanh()", [-1.0, 0.5], -INF, [INF, 0.0]),
    ("x.ln()", [0.0, 0.5], -INF, [INF, 0.0]),
    ("x.log2()", [0.0, 0.5], -INF, [INF, 0.0]),
    ("x.log10()", [0.0, 0.5], -INF, [INF, 0.0]),
    ("x.ln_1p()", [-1.0, 0.5], -INF, [INF, 0.0]),
    // A pole takes the side of the sign of its zero.
    ("x.recip()", [0.0, 0.5], INF, [-INF, 0.0]),
    ("x.recip()", [-0.0, 0.5], -INF, [-INF, 0.0]),
    ("x / y", [1.0, 0.0], INF, [INF, -INF]),
    ("x / y", [1.0, -0.0], -INF, [-INF, -INF]),
    ("x / y", [0.0, 0.0], NAN, [INF, NAN]),
    // nalgebra fills the poles of these two with 1.
    ("x.cosc()", [0.0, 0.5], 1.0, [0.0, 0.0]),
    ("x.coshc()", [0.0, 0.5], 1.0, [0.0, 0.0]),
    ("x.sinc()", [-0.0, 0.5], 1.0, [0.0, 0.0]),
    ("x.sinhc()", [0.0, 0.5], 1.0, [0.0, 0.0]),
    // The null vector has no angle.
    ("x.atan2(y)", [0.0, 0.0], 0.0, [NAN, NAN]),
    ("x.atan2(y)", [0.0, -1.0], PI, [-1.0, 0.0]),
    ("x.atan2(y)", [-0.0, -1.0], -PI, [-1.0, 0.0]),
    ("x.atan2(y)", [1.0, 0.0], FRAC_PI_2, [0.0, -1.0]),
    // Powers. A negative base has a value at whole exponents only, and no slope along the exponent.
    ("x.powi(0)", [0.0, 0.5], 1.0, [0.0, 0.0]),
    ("x.powi(1)", [0.0, 0.5], 0.0, [1.0, 0.0]),
    ("x.powi(2)", [-0.0, 0.5], 0.0, [0.0, 0.0]),
    ("x.powi(-1)", [0.0, 0.5], INF, [-INF, 0.0]),
    ("x.powf(y)", [0.0, 2.0], 0.0, [0.0, 0.0]),
    ("x.powf(y)", [0.0, 1.0], 0.0, [1.0, 0.0]),
    ("x.powf(y)", [0.0, 0.5], 0.0, [INF, 0.0]),
    ("x.powf(y)", [0.0, 0.0], 1.0, [0.0, -INF]),
    ("x.powf(y)", [2.0, 0.0], 1.0, [0.0, LN_2]),
    ("x.powf(y)", [-2.0, 2.0], 4.0, [-4.0, NAN]),
    // Where a function has settled, at infinity.
    ("x.tanh()", [INF, 0.5], 1.0, [0.0, 0.0]),
    ("x.atan()", [-INF, 0.5], -FRAC_PI_2, [0.0, 0.0]),
    ("x.exp()", [-INF, 0.5], 0.0, [0.0, 0.0]),
    ("x.exp_m1()", [-INF, 0.5], -1.0, [0.0, 0.0]),
    ("x.asinh()", [INF, 0.5], INF, [0.0, 0.0]),
    ("x.recip()", [INF, 0.5], 0.0, [0.0, 0.0]),
];

fn equal(a: f64, b: f64) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

#[test]
fn singular_points_follow_the_conventions_in_both_modes() {
    let cases = cases();
    let mut wrong = Vec::new();
    for (text, [x, y], value, slopes) in CONVENTIONS {
        let case = cases.iter().find(|case| case.text == *text).expect(text);
        for (mode, (v, d)) in
            [("forward", forward(case, *x, *y)), ("reverse", reverse(case, *x, *y))]
        {
            let right = equal(v, *value) && equal(d[0], slopes[0]) && equal(d[1], slopes[1]);
            if !right || (v == 0.0 && v.is_sign_negative() != value.is_sign_negative()) {
                wrong.push(format!("{mode} {text} at ({x}, {y}): {v}, {d:?}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Gradients of one function of two numbers by both modes.
macro_rules! both_modes {
    (|$x:ident, $y:ident| $body:expr, $at:expr) => {{
        fn function<S: Scalar>($x: S, $y: S) -> S {
            $body
        }
        let [x, y] = Fwd::<2>::variables($at);
        let by_forward = function(x, y).derivative;
        let recording = Recording::start();
        let [x, y] = recording.variables($at);
        let adjoints = recording.gradient(function(x, y));
        [by_forward, [adjoints.wrt(x), adjoints.wrt(y)]]
    }};
}

#[test]
fn a_constant_exponent_lets_the_base_be_negative() {
    for slopes in both_modes!(|x, y| x.powf(S::constant(2.0)) + y, [-2.0, 1.0]) {
        assert_eq!(slopes, [-4.0, 1.0]);
    }
}

#[test]
fn the_lowest_whole_exponent_is_taken() {
    let (x, n) = (1.0 + 1e-10, i32::MIN);
    let exact = f64::from(n) * f64::powf(x, f64::from(n) - 1.0);
    for [slope, _] in both_modes!(|x, y| x.powi(i32::MIN) + y, [1.0 + 1e-10, 1.0]) {
        assert!((slope - exact).abs() < 1e-6 * exact.abs(), "{slope} {exact}");
    }
}

#[test]
fn multiplying_and_adding_rounds_once() {
    let (x, y) = (1.0 + 2.0_f64.powi(-30), 1.0 - 2.0_f64.powi(-30));
    let exact = -(2.0_f64.powi(-60));
    assert_eq!(Fwd::<1>::variable(x, 0).mul_add(y.into(), (-1.0).into()).value, exact);
    let recording = Recording::start();
    let z = recording.variable(x).mul_add(recording.variable(y), Var::from(-1.0));
    assert_eq!(z.value(), exact);
}

#[test]
fn what_does_not_move_stops_an_infinite_slope() {
    for slopes in both_modes!(|x, y| (x * x + y * y).sqrt() + x, [0.0, 0.0]) {
        assert_eq!(slopes, [1.0, 0.0]);
    }
    for slopes in both_modes!(|x, y| (x * S::zero()).sqrt() + y, [2.0, 1.0]) {
        assert_eq!(slopes, [0.0, 1.0]);
    }
    for slopes in both_modes!(|x, y| Vector3::new(x, y, x * y).norm() + y, [0.0, 0.0]) {
        assert_eq!(slopes, [0.0, 1.0]);
    }
}

#[test]
fn constants_are_known_whatever_their_value() {
    let recording = Recording::start();
    for x in [0.0, 1.5, f64::NAN, f64::INFINITY] {
        assert!(x.is_constant());
        assert!(Fwd::<2>::constant(x).is_constant() && !Fwd::<2>::variable(x, 1).is_constant());
        let nested = Fwd::<1, Fwd<1>>::constant(x);
        assert!(nested.is_constant());
        let inner = Fwd { value: Fwd::<1>::variable(x, 0), ..nested };
        assert!(!inner.is_constant());
        assert!(!recording.variable(x).is_constant() && Var::from(x).is_constant());
    }
}
