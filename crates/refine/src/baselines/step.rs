//! Gauss–Newton steps of a pose.

use nalgebra::Vector6;
use prehend_autodiff::Quadratic;

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
