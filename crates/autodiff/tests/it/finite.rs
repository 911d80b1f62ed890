//! Finite numbers in, finite numbers out: every operation at its singular points and at the ends of the range of
//! `f64`, in value and in derivatives of both modes.

use nalgebra::{ComplexField, Matrix2, Matrix3, SVector, Vector2, Vector3, Vector6};
use prehend_autodiff::check::compare_gradients;
use prehend_autodiff::lie::{
    perturb_about, se3_adjoint, se3_exp, se3_left_jacobian, se3_log, so3_log,
};
use prehend_autodiff::optimize::{Adam, LevenbergMarquardt, NormalEquations, OptimizeError};
use prehend_autodiff::rigid::{conjugated, turned};
use prehend_autodiff::solve::{lu, sparse_lu};
use prehend_autodiff::{Fwd, Quadratic, Recording, Scalar};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

type Second<const N: usize> = Fwd<N, Fwd<N>>;

/// Zero of both signs, ones, subnormal numbers, and numbers whose squares, cubes or exponentials leave the range.
fn extremes() -> impl Strategy<Value = f64> {
    let magnitudes = [
        0.0,
        5e-324,
        1e-310,
        1e-200,
        1e-160,
        1e-9,
        0.5,
        1.0 - f64::EPSILON / 2.0,
        1.0,
        std::f64::consts::FRAC_PI_2,
        2.0,
        std::f64::consts::PI,
        360.0,
        800.0,
        1e9,
        1e16,
        1e150,
        1e155,
        1e200,
    ];
    let special = prop::sample::select(magnitudes.to_vec());
    let magnitude =
        prop_oneof![3 => special, 1 => (-320.0..300.0_f64).prop_map(|power| 10.0_f64.powf(power))];
    (magnitude, any::<bool>()).prop_map(|(x, negative)| if negative { -x } else { x })
}

/// A direction times a length that may be zero, tiny, about half a turn or a whole one, or huge.
fn vectors(largest: f64) -> impl Strategy<Value = Vector3<f64>> {
    use std::f64::consts::{PI, TAU};
    let offset = prop::sample::select(vec![0.0, 1e-16, -1e-16, 1e-9, -1e-9]);
    let about = (prop::sample::select(vec![0.1, 2.0, 4.0, PI, 1.5 * TAU]), offset)
        .prop_map(|(at, by)| at * (1.0 + by));
    let any_length =
        (-320.0..largest.log10()).prop_map(|power: f64| 10.0_f64.powf(power).min(1e60));
    let length = prop_oneof![1 => Just(0.0), 4 => about, 3 => any_length];
    let axis = prop_oneof![
        prop::sample::select(vec![Vector3::x(), -Vector3::y(), Vector3::z()]),
        [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0]
            .prop_filter_map("a direction", |axis| Vector3::from(axis).try_normalize(1e-3)),
    ];
    (axis, length).prop_map(|(axis, length)| axis * length)
}

const NAMES: [&str; 36] = [
    "+", "-", "*", "/", "%", "neg", "abs", "sin", "cos", "tan", "asin", "acos", "atan", "sinh",
    "cosh", "tanh", "asinh", "acosh", "atanh", "log2", "log10", "ln", "ln_1p", "sqrt", "cbrt",
    "exp", "exp2", "exp_m1", "sinc", "sinhc", "recip", "powi(2)", "powi(-3)", "powf", "hypot",
    "atan2",
];

fn operations<S: Scalar>(x: S, y: S) -> [S; 36] {
    [
        x + y,
        x - y,
        x * y,
        x / y,
        x % y,
        -x,
        x.abs(),
        x.sin(),
        x.cos(),
        x.tan(),
        x.asin(),
        x.acos(),
        x.atan(),
        x.sinh(),
        x.cosh(),
        x.tanh(),
        x.asinh(),
        x.acosh(),
        x.atanh(),
        x.log2(),
        x.log10(),
        x.ln(),
        x.ln_1p(),
        x.sqrt(),
        x.cbrt(),
        x.exp(),
        x.exp2(),
        x.exp_m1(),
        x.sinc(),
        x.sinhc(),
        x.recip(),
        x.powi(2),
        x.powi(-3),
        x.powf(y),
        x.hypot(y),
        x.atan2(y),
    ]
}

/// Everything that is computed from a twist and a vector, in one list.
fn motions<S: Scalar>(x: &[S]) -> Vec<S> {
    let xi = Vector6::from_column_slice(&x[..6]);
    let (rho, omega) = (Vector3::new(x[0], x[1], x[2]), Vector3::new(x[3], x[4], x[5]));
    let motion = se3_exp(&xi);
    let turn = motion.rotation;
    let mut all: Vec<S> = motion.to_homogeneous().iter().copied().collect();
    all.extend(perturb_about(&motion, &rho, &xi).to_homogeneous().iter());
    all.extend(se3_log(&motion).iter());
    all.extend(so3_log(&(turn * turn.inverse())).iter());
    for matrix in [se3_adjoint(&motion), se3_left_jacobian(&xi)] {
        all.extend(matrix.iter());
    }
    all.extend(turned(&turn, &omega).coords.iter());
    all.extend(
        conjugated(&turn, &Matrix3::new(1.0, 0.1, 0.0, 0.1, 2.0, 0.0, 0.0, 0.0, 3.0), &rho).iter(),
    );
    all
}

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(1),
        cases,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config(2000))]

    #[test]
    fn a_finite_value_has_no_nan_among_its_slopes(x in extremes(), y in extremes()) {
        let plain = operations(x, y);
        let [a, b] = Fwd::<2>::variables([x, y]);
        let forward = operations(a, b);
        let recording = Recording::start();
        let [a, b] = recording.variables([x, y]);
        let reverse = operations(a, b);
        for (k, name) in NAMES.into_iter().enumerate().filter(|(k, _)| plain[*k].is_finite()) {
            prop_assert!((forward[k].value - plain[k]).abs() <= 1e-14 * plain[k].abs(), "{name}");
            let adjoints = recording.gradient(reverse[k]);
            let undefined = [
                name == "atan2" && x == 0.0 && y == 0.0,
                name == "atan2" && x == 0.0 && y == 0.0 || name == "powf" && x < 0.0,
            ];
            for (i, by) in [a, b].into_iter().enumerate().filter(|(i, _)| !undefined[*i]) {
                let (f, r) = (forward[k].derivative[i], adjoints.wrt(by));
                prop_assert!(!f.is_nan() && f == r, "{name} by operand {i}: {f:e} {r:e}");
            }
        }
    }

    #[test]
    fn bounded_functions_have_bounded_second_derivatives(x in extremes()) {
        let v = Second::<1>::variable(Fwd::variable(x, 0), 0);
        for (name, y) in [("tanh", v.tanh()), ("atan", v.atan()), ("sin", v.sin()), ("sinc", v.sinc())] {
            let curvature = y.derivative[0].derivative[0];
            prop_assert!(curvature.abs() <= 1.0 + 1e-12, "{name}: {curvature:e}");
        }
    }

    #[test]
    fn rows_and_steps_of_quadratics(row in [extremes(), extremes(), extremes()], r in extremes(), damping in extremes()) {
        let mut sum = Quadratic::<3>::zeros();
        sum.add_row(&SVector::from(row), r, 1.0);
        prop_assert!(sum.damped_step(damping.abs()).iter().all(|x| x.is_finite()));
    }

    #[test]
    fn linear_systems_are_solved_or_refused(m in [extremes(), extremes(), extremes(), extremes()], b in [extremes(), extremes()]) {
        let Ok(factored) = lu(&Matrix2::new(m[0], m[1], m[2], m[3])) else { return Ok(()) };
        if let Ok(x) = factored.solve(&Vector2::from(b)) {
            prop_assert!(x.iter().all(|x| x.is_finite()));
        }
    }

    #[test]
    fn sparse_systems_are_solved_or_refused(m in [extremes(), extremes(), extremes(), extremes()], b in [extremes(), extremes()]) {
        let places = [(0, 0), (1, 0), (0, 1), (1, 1), (1, 1)];
        let values = [m[0], m[1], m[2], m[3], m[0]];
        let entries = std::array::from_fn::<_, 5, _>(|k| (places[k].0, places[k].1, values[k]));
        let Ok(factored) = sparse_lu(2, &entries) else { return Ok(()) };
        if let Ok(x) = factored.solve(&Vector2::from(b)) {
            prop_assert!(x.iter().all(|x| x.is_finite()));
        }
    }

    #[test]
    fn comparisons_of_gradients(a in [extremes(), extremes()], b in [extremes(), extremes()]) {
        let error = compare_gradients(&a, &b);
        prop_assert!(!error.relative.is_nan() && error.cosine.abs() <= 1.0 + 1e-15, "{error:?}");
        let same = compare_gradients(&a, &a);
        let zero = a.iter().all(|a| *a == 0.0);
        prop_assert!(same.relative == 0.0 && (zero || a[0].abs().max(a[1].abs()) < 1e-300 || same.cosine > 1.0 - 1e-15));
    }
}

proptest! {
    #![proptest_config(config(256))]

    #[test]
    fn motions_and_their_first_and_second_derivatives(rho in vectors(1e60), omega in vectors(1e60)) {
        let x = [rho.x, rho.y, rho.z, omega.x, omega.y, omega.z];
        prop_assert!(motions(&x).iter().all(|v| v.is_finite()));
        for (i, value) in motions(&Second::<6>::variables(Fwd::variables(x))).iter().enumerate() {
            for first in value.derivative {
                prop_assert!(first.value.is_finite() && first.derivative.iter().all(|d| d.is_finite()), "{i}");
            }
        }
        let recording = Recording::start();
        let inputs = recording.variables(x);
        for (i, value) in motions(&inputs).into_iter().enumerate() {
            let adjoints = recording.gradient(value);
            prop_assert!(inputs.iter().all(|v| adjoints.wrt(*v).is_finite()), "{i}");
        }
    }

    #[test]
    fn optimizers_end_at_a_finite_point(scale in extremes(), start in extremes()) {
        let residuals = |x: &[Fwd<2>]| {
            vec![x[0].times(scale) - Fwd::constant(1.0), (x[0] * x[1]).times(scale)]
        };
        let equations = |x: &[f64]| NormalEquations::forward::<2>(residuals, x);
        let slope = |x: &[f64]| {
            let at = equations(x);
            (at.value, at.gradient.as_slice().to_vec())
        };
        let start = [start, 1.0];
        for found in [
            Adam::default().minimize(&start, slope),
            LevenbergMarquardt::default().minimize(&start, equations),
            LevenbergMarquardt { damping: 0.0, ..Default::default() }.minimize(&start, equations),
        ] {
            match found {
                Ok(found) => prop_assert!(found.value.is_finite() && found.parameters.iter().all(|p| p.is_finite())),
                Err(error) => prop_assert_eq!(error, OptimizeError::ObjectiveNotFinite),
            }
        }
    }
}
