//! Derivatives of a law, against differences.

use prehend::autodiff::check::finite_difference_jacobian;
use prehend::autodiff::{Fwd, Scalar};
use prehend::geometry::SplitMix64;
use prehend::nalgebra::Vector3;
use prehend::sim::{ContactForce, ContactKinematics};

use super::finding::{Finding, Verdict};
use super::point_contact::{AREA, DEPTH, PointContact};

/// Contacts that are tried.
const CONTACTS: usize = 200;
/// Steps of differences: of the gap \[m\] and the speeds \[m/s\].
const STEPS: [f64; 4] = [1e-9, 1e-6, 1e-6, 1e-6];
/// Steps of differences by parameters, relative to their size.
const PARAMETER_STEP: f64 = 1e-6;
/// Error that is none, relative to the largest derivative by the same input.
const TOLERANCE: f64 = 1e-5;
/// Error of a force by rounding, relative to it.
const ROUNDING: f64 = 1e-14;
/// Part of the contacts that may lie at a kink.
const AT_KINKS: f64 = 0.02;

/// The derivatives by gap, normal speed and slip; then by the parameters.
pub(crate) fn findings(contact_point: &PointContact<'_>) -> Vec<Finding> {
    let mut random = SplitMix64::new(1);
    let (mut by_inputs, mut by_parameters, mut finite) = (Vec::new(), Vec::new(), true);
    for _ in 0..CONTACTS {
        let mut spread = || 2.0 * random.uniform() - 1.0;
        let at = [
            contact_point.law.cutoff() - DEPTH * (1.0 + 0.9 * spread()),
            0.5 * spread(),
            0.2 * spread(),
            0.2 * spread(),
        ];
        let p = contact_point.law.params();
        let exact = lifted(contact_point, &at, p, None);
        let moved =
            |change: &[f64]| force(contact_point, &std::array::from_fn(|i| at[i] + change[i]), p);
        by_inputs.push(differs(&exact, moved, &STEPS));
        finite &= exact.as_flattened().iter().all(|x| x.is_finite());
        for (k, value) in p.iter().enumerate() {
            let moved = |change: &[f64]| {
                let mut changed = p.to_vec();
                changed[k] += change[0];
                force(contact_point, &at, &changed)
            };
            let step = PARAMETER_STEP * value.abs().max(1e-3);
            by_parameters.push(differs(&lifted(contact_point, &at, p, Some(k)), moved, &[step]));
        }
    }
    let rest = [contact_point.law.cutoff() - DEPTH, 0.0, 0.0, 0.0];
    let at_rest = lifted(contact_point, &rest, contact_point.law.params(), None);
    finite &= at_rest.as_flattened().iter().all(|x| x.is_finite());
    let finding = |what: &str, wrong: &[bool]| {
        let share = wrong.iter().filter(|wrong| **wrong).count() as f64 / wrong.len() as f64;
        Finding {
            what: what.to_owned(),
            measured: share,
            verdict: Verdict::when(share <= AT_KINKS),
            remark: "0, or a little for kinks".to_owned(),
        }
    };
    let mut all = vec![finding("contacts whose derivatives differ from differences", &by_inputs)];
    if !by_parameters.is_empty() {
        all.push(finding("the same, derivatives by parameters", &by_parameters));
    }
    all.push(Finding {
        what: "derivatives that are finite, at rest too".to_owned(),
        measured: f64::from(u8::from(finite)),
        verdict: Verdict::when(finite),
        remark: "1".to_owned(),
    });
    all
}

fn contact<S: Scalar>([gap, normal_speed, x, y]: [S; 4]) -> ContactKinematics<S> {
    let slip = Vector3::new(x, y, S::zero());
    let normal = Vector3::z().map(S::constant);
    ContactKinematics { gap, normal_speed, slip, normal, area: S::constant(AREA) }
}

fn force(contact_point: &PointContact<'_>, at: &[f64; 4], p: &[f64]) -> [f64; 3] {
    let ContactForce { normal, tangential } = contact_point.law.force(p, &contact(*at));
    [normal, tangential.x, tangential.y]
}

/// Derivatives of the force by the four inputs, or first by a parameter, in forward mode.
fn lifted(
    contact_point: &PointContact<'_>,
    at: &[f64; 4],
    p: &[f64],
    parameter: Option<usize>,
) -> [[f64; 3]; 4] {
    let seed = |(k, &p): (usize, &f64)| match parameter == Some(k) {
        true => Fwd::<6>::variable(p, 0),
        false => Fwd::constant(p),
    };
    let params: Vec<Fwd<6>> = p.iter().enumerate().map(seed).collect();
    let inputs: [Fwd<6>; 4] = std::array::from_fn(|i| match parameter {
        Some(_) => Fwd::constant(at[i]),
        None => Fwd::variable(at[i], i),
    });
    let ContactForce { normal, tangential } =
        contact_point.law.force_with_derivative(&params, &contact(inputs));
    let force = [normal, tangential.x, tangential.y];
    std::array::from_fn(|i| force.map(|f| f.derivative[i]))
}

/// Whether derivatives by some of the inputs, the first of `exact`, differ from differences of the force at inputs `moved` by
/// `steps`, by more than rounding of the force may.
fn differs(exact: &[[f64; 3]; 4], moved: impl Fn(&[f64]) -> [f64; 3], steps: &[f64]) -> bool {
    let largest = |x: &[f64]| x.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    let scaled = |x: &[f64]| {
        let change: Vec<f64> = x.iter().zip(steps).map(|(x, step)| x * step).collect();
        moved(&change).to_vec()
    };
    let at = vec![0.0; steps.len()];
    let rounding = ROUNDING * largest(&scaled(&at));
    let differences = finite_difference_jacobian(scaled, &at, 1.0);
    steps.iter().zip(exact).enumerate().any(|(input, (step, exact))| {
        let exact = exact.map(|x| x * step);
        let bound = TOLERANCE * largest(&exact) + rounding;
        let mut errors = exact.iter().zip(&differences).map(|(x, row)| (x - row[input]).abs());
        errors.any(|error| error.is_nan() || error > bound)
    })
}
