//! Every scalar function and operator, in both modes, against the other mode, against differences, at
//! singular points and at the ends of the range of `f64`.

mod conventions;
mod extremes;
mod table;

use prehend_autodiff::check::finite_difference_gradient;
use prehend_autodiff::{Fwd, Recording};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use table::{Case, Changes, METHODS, cases};

/// Value and the two partial derivatives.
type Jet = (f64, [f64; 2]);

fn forward(case: &Case, x: f64, y: f64) -> Jet {
    let [vx, vy] = Fwd::variables([x, y]);
    let z = (case.forward)(vx, vy);
    (z.value, z.derivative)
}

fn reverse(case: &Case, x: f64, y: f64) -> Jet {
    let recording = Recording::start();
    let [vx, vy] = recording.variables([x, y]);
    let z = (case.reverse)(vx, vy);
    let adjoints = recording.gradient(z);
    (z.value(), [adjoints.wrt(vx), adjoints.wrt(vy)])
}

/// Jets with each operand in turn a constant, so that single-operand paths are taken.
fn one_by_one(case: &Case, x: f64, y: f64) -> [Jet; 2] {
    let [fx, fy] = Fwd::variables([x, y]);
    let by_x = (case.forward)(fx, Fwd::from(y));
    let by_y = (case.forward)(Fwd::from(x), fy);
    let recording = Recording::start();
    let [vx, vy] = recording.variables([x, y]);
    let rx = recording.gradient((case.reverse)(vx, y.into())).wrt(vx);
    let ry = recording.gradient((case.reverse)(x.into(), vy)).wrt(vy);
    [(by_x.value, [by_x.derivative[0], by_y.derivative[1]]), ((case.plain)(x, y), [rx, ry])]
}

/// Both operands the same variable, scaled so that the result is fused twice over.
fn repeated(case: &Case, x: f64) -> [f64; 2] {
    let v = Fwd::<2>::variable(x, 0);
    let two = 2.0.into();
    let by_forward = (case.forward)(v, v * two).derivative[0];
    let recording = Recording::start();
    let v = recording.variable(x);
    let z = (case.reverse)(v, v * 2.0.into());
    [by_forward, recording.gradient(z).wrt(v)]
}

fn same(a: f64, b: f64) -> bool {
    a == b || (a.is_nan() && b.is_nan()) || (a - b).abs() <= 1e-12 * a.abs().max(b.abs())
}

/// Whether no jump of any of the functions with jumps lies between the two points.
fn same_piece(a: [f64; 2], b: [f64; 2]) -> bool {
    let piece = |[x, y]: [f64; 2]| {
        let cells = [x.floor(), x.round(), (x / y).trunc(), (y / x).trunc(), (x - y).floor()];
        (cells.map(|c| c as i64), x > 0.0, y > 0.0, x > 3.0, y > 3.0)
    };
    piece(a) == piece(b)
}

fn config() -> ProptestConfig {
    ProptestConfig {
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(1),
        ..ProptestConfig::default()
    }
}

#[test]
fn every_method_has_a_case() {
    let cases = cases();
    for method in METHODS {
        assert!(cases.iter().any(|case| case.method == *method), "no case for `{method}`");
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn the_modes_agree(at in [0.0..1.0, 0.0..1.0_f64], negative in any::<[bool; 2]>()) {
        let mut wrong = Vec::new();
        for case in cases() {
            let [x, y] = [0, 1].map(|i| case.domains[i].at(at[i], negative[i]));
            let mut check = |what: &str, a: f64, b: f64| {
                if !same(a, b) {
                    wrong.push(format!("{what} of {} at ({x:e}, {y:e}): {a:e}, {b:e}", case.text));
                }
            };
            let (value, slopes) = forward(&case, x, y);
            check("value", value, (case.plain)(x, y));
            for (v, d) in [reverse(&case, x, y)].into_iter().chain(one_by_one(&case, x, y)) {
                check("value", value, v);
                check("slope 0", slopes[0], d[0]);
                check("slope 1", slopes[1], d[1]);
            }
            let [a, b] = repeated(&case, x);
            check("slope of twice the same operand", a, b);
        }
        prop_assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    }

    #[test]
    fn slopes_are_those_of_differences(
        at in [0.0..1.0, 0.0..1.0_f64],
        negative in any::<[bool; 2]>(),
    ) {
        let mut wrong = Vec::new();
        for case in cases() {
            let at = [0, 1].map(|i| case.domains[i].at(at[i], negative[i]));
            let (value, slopes) = forward(&case, at[0], at[1]);
            for i in 0..2 {
                let scale = case.domains[i].scale(at[i]);
                let step = 1e-3 * scale;
                let with = |v: f64| {
                    let mut point = at;
                    point[i] = v;
                    point
                };
                if case.domains[i].changes == Changes::InPieces
                    && !same_piece(with(at[i] - step), with(at[i] + step))
                {
                    continue;
                }
                let plain = |v: &[f64]| {
                    let [x, y] = with(v[0]);
                    (case.plain)(x, y)
                };
                let difference = finite_difference_gradient(plain, &[at[i]], step)[0];
                let rounding = slopes[i].abs() * (at[i].abs() / scale) + value.abs() / scale;
                // Below the smallest normal number there are no digits to compare.
                let tolerance = 1e-9 * rounding + f64::MIN_POSITIVE;
                let error = (slopes[i] - difference).abs();
                if error.is_nan() || error > tolerance {
                    let slope = slopes[i];
                    wrong.push(format!("slope {i} of {} at {at:?}: {slope:e}, {difference:e}", case.text));
                }
            }
        }
        prop_assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    }
}
