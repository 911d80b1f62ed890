//! Gauss–Newton steps of a pose.

use nalgebra::Vector6;
use prehend_autodiff::Quadratic;

use crate::problem::{Block, State};
use crate::strategy::{Iteration, Recorder};

/// The damped Gauss–Newton step in units where a radian counts `radius` meters, no longer than `limit`; and its length in these
/// units \[m\].
pub(super) fn damped_step(
    equations: &Quadratic<6>,
    radius: f64,
    damping: f64,
    limit: f64,
) -> (Vector6<f64>, f64) {
    let turn = 1.0 / radius;
    let units = Vector6::new(1.0, 1.0, 1.0, turn, turn, turn);
    let step = equations.in_units(&units).damped_step(damping);
    let norm = step.norm();
    if !(norm > 0.0 && norm.is_finite()) {
        return (Vector6::zeros(), 0.0);
    }
    let length = norm.min(limit);
    (step.component_mul(&units) * (length / norm), length)
}

/// Rule of a descent whose steps follow each other without any choice among them.
pub(super) struct StepRule {
    /// Steps at most.
    pub(super) iterations: usize,
    /// The walk ends once a step is no longer than this \[m\].
    pub(super) tolerance: f64,
    /// Damping of the steps, as a part of the mean curvature.
    pub(super) damping: f64,
}

/// Makes damped Gauss–Newton steps of the object from `state` by the value and the `equations` at every state and iteration; `radius` is
/// the object's \[m\].
pub(super) fn walk(
    recorder: &mut Recorder<'_, '_>,
    mut state: State,
    radius: f64,
    rule: &StepRule,
    mut equations: impl FnMut(&State, usize) -> (f64, Quadratic<6>),
) {
    for index in 0..=rule.iterations {
        let (value, equations) = equations(&state, index);
        let (step, length) = damped_step(&equations, radius, rule.damping, f64::INFINITY);
        let iteration = Iteration { index, values: vec![value], weights: vec![1.0], step: length };
        if recorder.visit(&state, iteration, None).is_break() || length <= rule.tolerance {
            break;
        }
        state = state.retract(&[Block::ObjectPose], step.as_slice());
    }
}
