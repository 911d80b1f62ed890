//! Errors of a pose by itself.

use nalgebra::{Isometry3, UnitQuaternion};

use crate::symmetry::Symmetries;

/// Position error: the distance of the two model origins \[cm\].
pub fn pe_cm(estimate: &Isometry3<f64>, truth: &Isometry3<f64>) -> f64 {
    (estimate.translation.vector - truth.translation.vector).norm() * 100.0
}

/// Orientation error: the angle acos(2⟨q̂, q⟩² − 1) between two orientations \[deg\], evaluated as
/// 2 atan2(|v|, |w|) of the relative quaternion, which keeps full precision at small angles.
pub fn oe_deg(estimate: &Isometry3<f64>, truth: &Isometry3<f64>) -> f64 {
    angle(&(estimate.rotation.inverse() * truth.rotation)).to_degrees()
}

/// The smallest orientation error \[deg\] over all orientations that symmetry makes equal to the truth;
/// for an axis of revolution this is exact, not discretized.
pub fn oe_symmetric_deg(
    estimate: &Isometry3<f64>,
    truth: &Isometry3<f64>,
    symmetries: &Symmetries,
) -> f64 {
    let relative = estimate.rotation.inverse() * truth.rotation;
    let mut least = f64::INFINITY;
    for discrete in symmetries.discrete_with_identity() {
        if symmetries.continuous.is_empty() {
            least = least.min(angle(&(relative * discrete.rotation)));
        }
        for continuous in &symmetries.continuous {
            // The truth may be turned to relative · spin · discrete; an angle does not change when factors
            // are cycled, so the spin acts on q, and its best value leaves the swing of q about the axis.
            let q = discrete.rotation * relative;
            let along = q.imag().dot(&continuous.axis);
            let swing = (q.imag() - along * continuous.axis.into_inner()).norm();
            least = least.min(2.0 * swing.atan2(q.w.hypot(along)));
        }
    }
    least.to_degrees()
}

fn angle(q: &UnitQuaternion<f64>) -> f64 {
    2.0 * q.imag().norm().atan2(q.w.abs())
}
