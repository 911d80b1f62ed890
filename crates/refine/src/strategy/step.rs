//! Gauss–Newton steps of a pose.

use nalgebra::{Matrix6, Vector6};

use super::Iteration;
use super::estimate::Recorder;
use crate::problem::{Block, NormalEquations, State};

/// −(H + μ)⁻¹ g in units where a radian counts `radius` meters, no longer than `limit`; and its length
/// in these units \[m\]. μ is a thousandth of the mean curvature.
pub(super) fn preconditioned_step(
    equations: &NormalEquations,
    radius: f64,
    limit: f64,
) -> (Vector6<f64>, f64) {
    damped_step(equations, radius, 1e-3, limit)
}

/// As [`preconditioned_step`], μ being the part `damping` of the mean curvature.
pub(super) fn damped_step(
    equations: &NormalEquations,
    radius: f64,
    damping: f64,
    limit: f64,
) -> (Vector6<f64>, f64) {
    let unit = Vector6::new(1.0, 1.0, 1.0, 1.0 / radius, 1.0 / radius, 1.0 / radius);
    let gradient = Vector6::from_column_slice(equations.gradient().as_slice()).component_mul(&unit);
    let hessian = Matrix6::from_column_slice(equations.hessian().as_slice());
    let hessian = Matrix6::from_fn(|r, c| unit[r] * hessian[(r, c)] * unit[c]);
    // Directions that the term says nothing about (a cylinder's spin) must not become long steps.
    let damping = damping * hessian.trace() / 6.0 + f64::MIN_POSITIVE;
    let step = (hessian + Matrix6::identity() * damping)
        .cholesky()
        .map_or_else(Vector6::zeros, |factor| -factor.solve(&gradient));
    let norm = step.norm();
    if !(norm.is_finite() && norm > 0.0) {
        return (Vector6::zeros(), 0.0);
    }
    let length = norm.min(limit);
    (step.component_mul(&unit) * (length / norm), length)
}

/// How a walk of steps that follow each other without any choice among them goes.
pub(super) struct StepRule {
    /// Steps at most.
    pub(super) iterations: usize,
    /// The walk ends once a step is no longer than this \[m\].
    pub(super) tolerance: f64,
    /// Damping of the steps, as a part of the mean curvature.
    pub(super) damping: f64,
}

/// Makes damped Gauss–Newton steps of the object from `state` by the `equations` of every state and iteration, which returns the value
/// that it lowers; `radius` is the object's \[m\].
pub(super) fn walk(
    recorder: &mut Recorder<'_, '_>,
    mut state: State,
    radius: f64,
    rule: &StepRule,
    mut equations: impl FnMut(&State, usize, &mut NormalEquations) -> f64,
) {
    for index in 0..=rule.iterations {
        let mut sums = NormalEquations::new(&[Block::ObjectPose]);
        let value = equations(&state, index, &mut sums);
        let (step, length) = damped_step(&sums, radius, rule.damping, f64::INFINITY);
        let iteration = Iteration { index, values: vec![value], weights: vec![1.0], step: length };
        if recorder.visit(&state, iteration).is_break() || length <= rule.tolerance {
            break;
        }
        state = state.retract(&[Block::ObjectPose], step.as_slice());
    }
}
