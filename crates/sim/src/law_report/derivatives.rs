//! Derivatives of a law, against differences.

use nalgebra::Vector3;
use prehend_autodiff::{Fwd, Scalar};
use prehend_geometry::SplitMix64;

use super::{AREA, DEPTH, Finding, Probe, Verdict};
use crate::contact::point::{Contact, Response};

/// Contacts that are tried.
const CONTACTS: usize = 200;
/// Steps of differences: of the gap \[m\] and the speeds \[m/s\].
const STEPS: [f64; 4] = [1e-9, 1e-6, 1e-6, 1e-6];
/// Of parameters, relative to their size.
const PARAMETER_STEP: f64 = 1e-6;
/// Part of the contacts that may lie at a kink.
const AT_KINKS: f64 = 0.02;

/// The derivatives by gap, normal speed and slip; then by the parameters.
pub(super) fn findings(probe: &Probe<'_>) -> Vec<Finding> {
    let mut random = SplitMix64::new(1);
    let (mut off, mut by_parameters, mut finite) = (Vec::new(), Vec::new(), true);
    for _ in 0..CONTACTS {
        let mut spread = || 2.0 * random.uniform() - 1.0;
        let at = [
            probe.law.reach() - DEPTH * (1.0 + 0.9 * spread()),
            0.5 * spread(),
            0.2 * spread(),
            0.2 * spread(),
        ];
        let p = probe.law.params();
        let by_inputs = lifted(probe, &at, p, None);
        off.push(error(&STEPS, |i, h| force(probe, &moved(&at, i, h), p), &by_inputs));
        for k in 0..p.len() {
            let change = |_, h: f64| {
                let mut changed = p.to_vec();
                changed[k] += h;
                force(probe, &at, &changed)
            };
            let step = PARAMETER_STEP * p[k].abs().max(1e-3);
            by_parameters.push(error(&[step], change, &lifted(probe, &at, p, Some(k))));
        }
        finite &= by_inputs.as_flattened().iter().all(|x| x.is_finite());
    }
    let rest = [probe.law.reach() - DEPTH, 0.0, 0.0, 0.0];
    let at_rest = lifted(probe, &rest, probe.law.params(), None);
    finite &= at_rest.as_flattened().iter().all(|x| x.is_finite());
    let finding = |what: &str, errors: Vec<f64>| {
        let wrong = errors.iter().filter(|e| e.is_nan() || **e > 1e-5).count() as f64;
        let share = wrong / errors.len().max(1) as f64;
        Finding {
            what: what.to_owned(),
            measured: share,
            verdict: Verdict::when(share <= AT_KINKS),
            remark: "0, or a little for kinks".to_owned(),
        }
    };
    let mut all = vec![finding("contacts whose derivatives differ from differences", off)];
    if !by_parameters.is_empty() {
        all.push(finding("the same, derivatives by parameters", by_parameters));
    }
    all.push(Finding {
        what: "derivatives that are finite, at rest too".to_owned(),
        measured: f64::from(u8::from(finite)),
        verdict: Verdict::when(finite),
        remark: "1".to_owned(),
    });
    all
}

fn moved(at: &[f64; 4], i: usize, h: f64) -> [f64; 4] {
    let mut moved = *at;
    moved[i] += h;
    moved
}

fn contact<S: Scalar>([gap, normal_speed, x, y]: [S; 4]) -> Contact<S> {
    let slip = Vector3::new(x, y, S::zero());
    let normal = Vector3::z().map(S::constant);
    Contact { gap, normal_speed, slip, normal, area: AREA }
}

fn force(probe: &Probe<'_>, at: &[f64; 4], p: &[f64]) -> [f64; 3] {
    let Response { normal, tangential } = probe.law.response(p, &contact(*at));
    [normal, tangential.x, tangential.y]
}

/// Derivatives of the force by the four inputs, or first by a parameter, in forward mode.
fn lifted(probe: &Probe<'_>, at: &[f64; 4], p: &[f64], parameter: Option<usize>) -> [[f64; 3]; 4] {
    let seed = |(k, &p): (usize, &f64)| match parameter == Some(k) {
        true => Fwd::<6>::variable(p, 0),
        false => Fwd::constant(p),
    };
    let params: Vec<Fwd<6>> = p.iter().enumerate().map(seed).collect();
    let inputs: [Fwd<6>; 4] = std::array::from_fn(|i| match parameter {
        Some(_) => Fwd::constant(at[i]),
        None => Fwd::variable(at[i], i),
    });
    let Response { normal, tangential } =
        probe.law.response_with_derivative(&params, &contact(inputs));
    let force = [normal, tangential.x, tangential.y];
    std::array::from_fn(|i| force.map(|f| f.derivative[i]))
}

/// The largest error of `exact` against central differences of `at` with `steps`, relative to the largest derivative by the same
/// input, and to what rounding leaves of it.
fn error(steps: &[f64], at: impl Fn(usize, f64) -> [f64; 3], exact: &[[f64; 3]; 4]) -> f64 {
    let of_input = |(i, step): (usize, &f64)| {
        let (plus, minus) = (at(i, *step), at(i, -step));
        let largest = |x: &[f64; 3]| x.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        let scale = largest(&exact[i]).max(1e-6 * largest(&plus) / step * 1e-3);
        let off = |k: usize| ((plus[k] - minus[k]) / (2.0 * step) - exact[i][k]).abs();
        (0..3).map(off).fold(0.0, worst) / scale.max(f64::MIN_POSITIVE)
    };
    steps.iter().enumerate().map(of_input).fold(0.0, worst)
}

/// The larger, and what is no number rather than either.
fn worst(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}
