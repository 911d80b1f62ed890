//! The Lie groups at random motions: the laws that tie the functions together, and their derivatives of
//! first and second order in both modes, with angles at and around every switch between formulas.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Matrix3, Matrix6, Vector3, Vector6};
use prehend_autodiff::check::finite_difference_jacobian;
use prehend_autodiff::lie::{
    se3_adjoint, se3_exp, se3_left_jacobian, se3_log, so3_exp, so3_left_jacobian,
    so3_left_jacobian_inverse, so3_log, so3_right_jacobian, so3_right_jacobian_inverse,
};
use prehend_autodiff::{Fwd, Recording, Scalar};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// A twist whose angle is drawn from where something happens: zero, its surroundings over many
/// magnitudes, both sides of the switches at 0.1, 0.2, 2 and 4, the surroundings of π, and anywhere.
fn twists(largest: f64) -> impl Strategy<Value = [f64; 6]> {
    let offset = (-16.0..-1.0_f64, any::<bool>())
        .prop_map(|(power, below)| 10.0_f64.powf(power) * if below { -1.0 } else { 1.0 });
    let angle = prop_oneof![
        1 => Just(0.0),
        2 => (-200.0..0.0_f64).prop_map(|power| 10.0_f64.powf(power)),
        4 => (prop::sample::select(vec![0.1, 0.2, 2.0, 4.0, PI]), offset)
            .prop_map(|(at, by)| at * (1.0 + by)),
        3 => 0.0..TAU,
    ];
    let direction = [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0];
    (direction.clone(), direction, angle).prop_filter_map(
        "a direction, and an angle within the limit",
        move |(rho, axis, angle)| {
            let omega = Vector3::from(axis).try_normalize(1e-3)? * angle;
            let within = angle < largest;
            within.then_some([rho[0], rho[1], rho[2], omega.x, omega.y, omega.z])
        },
    )
}

fn angle(x: &[f64; 6]) -> f64 {
    Vector3::new(x[3], x[4], x[5]).norm()
}

fn twist<S: Scalar>(x: &[S]) -> Vector6<S> {
    Vector6::from_column_slice(x)
}

fn entries<S: Scalar>(motion: &Isometry3<S>) -> Vec<S> {
    motion.to_homogeneous().iter().copied().collect()
}

/// Everything that is computed from a twist, in one list.
fn everything<S: Scalar>(x: &[S]) -> Vec<S> {
    let xi = twist(x);
    let motion = se3_exp(&xi);
    let mut all = entries(&motion);
    all.extend(se3_adjoint(&motion).iter());
    all.extend(se3_left_jacobian(&xi).iter());
    all
}

/// `everything` and its Jacobian, row by row, by forward mode.
fn jacobian(x: &[f64; 6]) -> Vec<[f64; 6]> {
    everything(&Fwd::<6>::variables(*x)).iter().map(|v| v.derivative).collect()
}

fn config() -> ProptestConfig {
    ProptestConfig {
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(1),
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn logarithms_invert_exponentials(x in twists(PI * (1.0 - 1e-14))) {
        let back = se3_log(&se3_exp(&twist(&Fwd::<6>::variables(x))));
        for (i, b) in back.iter().enumerate() {
            prop_assert!((b.value - x[i]).abs() <= 1e-14, "{i}: {b:?}");
            for (j, d) in b.derivative.iter().enumerate() {
                let exact = if i == j { 1.0 } else { 0.0 };
                prop_assert!((d - exact).abs() < 1e-13, "{i}, {j}: {d}");
            }
        }
    }

    #[test]
    fn tiny_rotations_keep_all_their_digits(x in twists(1e-3)) {
        let omega = Vector3::new(x[3], x[4], x[5]);
        let error = (so3_log(&so3_exp(&omega)) - omega).norm();
        prop_assert!(error <= 4e-16 * omega.norm());
    }

    #[test]
    fn exponentials_invert_logarithms_beyond_half_a_turn(x in twists(TAU)) {
        let motion = se3_exp(&twist(&x));
        let twist = se3_log(&motion);
        prop_assert!(twist.fixed_rows::<3>(3).norm() <= PI * (1.0 + 1e-15));
        let error = (se3_exp(&twist).to_homogeneous() - motion.to_homogeneous()).norm();
        prop_assert!(error < 1e-14, "{error:e}");
    }

    #[test]
    fn jacobians_are_the_derivatives_of_the_exponential(x in twists(TAU)) {
        let moved = se3_exp(&twist(&Fwd::<6>::variables(x)));
        let still = se3_exp(&twist(&x)).cast::<Fwd<6>>();
        let step = se3_log(&(moved * still.inverse()));
        let derivative = Matrix6::from_fn(|r, c| step[r].derivative[c]);
        let jacobian = se3_left_jacobian(&twist(&x));
        prop_assert!((derivative - jacobian).norm() < 2e-14, "{derivative} {jacobian}");
    }

    #[test]
    fn left_and_right_jacobians_differ_by_the_adjoint(x in twists(TAU)) {
        let omega = Vector3::new(x[3], x[4], x[5]);
        let rotation = so3_exp(&omega).to_rotation_matrix();
        let error = so3_left_jacobian(&omega) - rotation * so3_right_jacobian(&omega);
        prop_assert!(error.norm() < 1e-14, "{error}");
    }

    #[test]
    fn inverse_jacobians_invert(x in twists(0.999 * TAU)) {
        let omega = Vector3::new(x[3], x[4], x[5]);
        // They grow without bound towards a full turn, and their error with the square.
        let near = 1.0 / (1.0 - angle(&x) / TAU);
        for product in [
            so3_left_jacobian(&omega) * so3_left_jacobian_inverse(&omega),
            so3_right_jacobian(&omega) * so3_right_jacobian_inverse(&omega),
        ] {
            let error = (product - Matrix3::identity()).norm();
            prop_assert!(error < 1e-14 * near, "{error:e}");
        }
    }

    #[test]
    fn adjoints_form_a_group(x in twists(TAU), y in twists(TAU)) {
        let (a, b) = (se3_exp(&twist(&x)), se3_exp(&twist(&y)));
        let error = se3_adjoint(&(a * b)) - se3_adjoint(&a) * se3_adjoint(&b);
        prop_assert!(error.norm() < 2e-14, "{error}");
    }

    #[test]
    fn the_modes_agree(x in twists(0.9 * TAU), weights in [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0]) {
        let by_forward = jacobian(&x);
        let recording = Recording::start();
        let inputs = recording.variables(x);
        let outputs = everything(&inputs);
        let weight = |i: usize| weights[i % 3];
        let seeds: Vec<_> = outputs.iter().enumerate().map(|(i, v)| (*v, weight(i))).collect();
        let adjoints = recording.vjp(&seeds);
        for (k, input) in inputs.iter().enumerate() {
            let products = by_forward.iter().enumerate().map(|(i, row)| weight(i) * row[k]);
            let (sum, size) = products.fold((0.0, 0.0), |(s, a), p| (s + p, a + p.abs()));
            let error = (adjoints.wrt(*input) - sum).abs();
            prop_assert!(error <= 1e-12 * (1.0 + size), "{k}: {error:e}");
        }
    }

    #[test]
    fn derivatives_are_those_of_differences(x in twists(0.9 * TAU)) {
        let differences = finite_difference_jacobian(everything, &x, 1e-3);
        for (i, (row, exact)) in differences.iter().zip(&jacobian(&x)).enumerate() {
            for (d, e) in row.iter().zip(exact) {
                prop_assert!((d - e).abs() < 1e-8 * (1.0 + e.abs()), "{i}: {d} {e}");
            }
        }
    }

    #[test]
    fn derivatives_change_smoothly_across_the_switches(x in twists(0.9 * TAU)) {
        // Differences of the exact first derivative, which see an error of 1e-12 in it as 1e-9.
        let flat = |s: &[f64]| -> Vec<f64> {
            let point = std::array::from_fn(|i| s[i]);
            jacobian(&point).concat()
        };
        let [coarse, fine] =
            [1e-3, 5e-4].map(|step| finite_difference_jacobian(flat, &x, step).concat());
        for (i, (c, f)) in coarse.iter().zip(&fine).enumerate() {
            prop_assert!((c - f).abs() < 3e-8 * (1.0 + f.abs()), "{i}: {c} {f}");
        }
    }
}
