//! Least-squares problems on manifolds and their quadratic models.

use nalgebra::{DMatrix, DVector};

use super::OptimizeError;
use super::iterate::Evaluation;

/// A sum of squares over parameters that lie on a manifold, such as poses.
pub trait LeastSquares {
    /// Where the parameters are.
    type Point: Clone;
    /// Quadratic model of the sum about a point.
    type Linearization: QuadraticModel;

    /// The sum about `at`, by the directions of the tangent space there.
    fn linearize(&self, at: &Self::Point) -> Self::Linearization;

    /// The sum about each of several points, one for each and in their order: together, where that takes less than one after the
    /// other.
    fn linearize_all(&self, points: &[Self::Point]) -> Vec<Self::Linearization> {
        points.iter().map(|at| self.linearize(at)).collect()
    }

    /// The point that `step` of the tangent space at `at` leads to.
    fn retract(&self, at: &Self::Point, step: &[f64]) -> Self::Point;
}

/// Gauss and Newton's quadratic model of ½‖r‖² about a point.
pub trait QuadraticModel {
    /// ½‖r‖².
    fn value(&self) -> f64;

    /// Jᵀr, shape \[parameters\].
    fn gradient(&self) -> &DVector<f64>;

    /// JᵀJ, shape \[parameters, parameters\]; of this symmetric matrix the lower triangle is read.
    fn hessian(&self) -> &DMatrix<f64>;
}

/// A quadratic model as the loop of all methods sees it.
pub(super) struct Linearized<M>(pub(super) M);

impl<M: QuadraticModel> Evaluation for Linearized<M> {
    fn value(&self) -> f64 {
        self.0.value()
    }

    fn gradient(&self) -> &[f64] {
        self.0.gradient().as_slice()
    }

    fn is_finite(&self) -> bool {
        let derivatives = self.0.gradient().iter().chain(self.0.hessian());
        self.0.value().is_finite() && derivatives.into_iter().all(|entry| entry.is_finite())
    }

    fn check_shape(&self, expected: usize) -> Result<(), OptimizeError> {
        let found = self.0.gradient().len();
        if found != expected {
            return Err(OptimizeError::GradientLength { expected, found });
        }
        let (rows, columns) = self.0.hessian().shape();
        if (rows, columns) != (expected, expected) {
            return Err(OptimizeError::MatrixShape { expected, rows, columns });
        }
        Ok(())
    }
}
