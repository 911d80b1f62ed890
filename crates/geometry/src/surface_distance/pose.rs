//! Derivatives of squared distances by the pose of the mesh.

use nalgebra::{Matrix6, Point3, SMatrix, Vector6};
use prehend_autodiff::lie::cross_matrix;

use super::pair::Pair;
use crate::RobustKernel;

/// A distance and its derivatives by a left twist of the mesh about a center, translation \[m\] first, rotation
/// \[rad\] last, at zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseDerivatives {
    /// The distance \[m²\].
    pub value: f64,
    /// Its gradient.
    pub gradient: Vector6<f64>,
    /// The part of the Hessian that is positive semi-definite whatever the residuals: weights are held, points
    /// move along straight lines. It knows that a surface may slide along itself, but not about a corner.
    pub gauss_newton: Matrix6<f64>,
    /// The exact Hessian, where no match is about to change.
    pub hessian: Matrix6<f64>,
}

impl Default for PoseDerivatives {
    fn default() -> Self {
        let zero = Matrix6::zeros();
        Self { value: 0.0, gradient: Vector6::zeros(), gauss_newton: zero, hessian: zero }
    }
}

impl PoseDerivatives {
    /// Adds `share` times twice the loss of one match.
    ///
    /// With the mesh moved by δ = (ρ, ω), the point y = p − c moves in the mesh's frame by
    /// −(ρ + ω × y) + ½ ω × (ρ + ω × y); the squared distance d² has gradient 2 r by it, and Hessian 2 P.
    pub(super) fn add(
        &mut self,
        pair: &Pair,
        center: &Point3<f64>,
        kernel: RobustKernel,
        share: f64,
    ) {
        let (r, y) = (pair.offset(), pair.point - center);
        let r2 = r.norm_squared();
        let weight = share * kernel.weight(r2);
        self.value += share * 2.0 * kernel.loss(r2);

        let mut jacobian = SMatrix::<f64, 3, 6>::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&-cross_matrix(&y));
        let slope = jacobian.transpose() * r * -2.0;
        self.gradient += slope * weight;

        let straight = jacobian.transpose() * pair.curvature() * jacobian * (2.0 * weight);
        self.gauss_newton += straight;
        self.hessian += straight;

        // r · (ω × (ω × y)) = (r·ω)(ω·y) − (ω·ω)(r·y), and r · (ω × ρ).
        let outer = r * y.transpose();
        let mut turning = outer + outer.transpose();
        for i in 0..3 {
            turning[(i, i)] -= 2.0 * r.dot(&y);
        }
        let mixed = cross_matrix(&r) * weight;
        let mut bend = Matrix6::zeros();
        bend.fixed_view_mut::<3, 3>(3, 3).copy_from(&(turning * weight));
        bend.fixed_view_mut::<3, 3>(0, 3).copy_from(&mixed);
        bend.fixed_view_mut::<3, 3>(3, 0).copy_from(&mixed.transpose());
        self.hessian += bend;
        self.hessian += slope * slope.transpose() * (share * kernel.weight_derivative(r2));
    }

    /// Adds the sums of other matches about the same center.
    pub(super) fn merge(&mut self, other: &Self) {
        self.value += other.value;
        self.gradient += other.gradient;
        self.gauss_newton += other.gauss_newton;
        self.hessian += other.hessian;
    }
}
