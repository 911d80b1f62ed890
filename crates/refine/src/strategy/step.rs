//! Gauss–Newton steps of a pose.

use nalgebra::{Matrix6, Vector6};

use crate::problem::Normal;

/// −(H + μ)⁻¹ g in units where a radian counts `radius` meters, no longer than `limit`; and its length
/// in these units \[m\]. μ is a thousandth of the mean curvature.
pub(crate) fn preconditioned_step(normal: &Normal, radius: f64, limit: f64) -> (Vector6<f64>, f64) {
    damped_step(normal, radius, 1e-3, limit)
}

/// As [`preconditioned_step`], μ being the part `damping` of the mean curvature.
pub(crate) fn damped_step(
    normal: &Normal,
    radius: f64,
    damping: f64,
    limit: f64,
) -> (Vector6<f64>, f64) {
    let unit = Vector6::new(1.0, 1.0, 1.0, 1.0 / radius, 1.0 / radius, 1.0 / radius);
    let gradient = Vector6::from_column_slice(normal.gradient().as_slice()).component_mul(&unit);
    let hessian = Matrix6::from_column_slice(normal.hessian().as_slice());
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
