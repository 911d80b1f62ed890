//! Factorized matrices.

use nalgebra::DMatrix;

/// Factorized matrix A. It solves AX = B and AᵀX = B in place, for any number of right-hand sides.
pub(super) trait Factors: Send + Sync + 'static {
    fn solve(&self, rhs: &mut DMatrix<f64>);
    fn solve_transpose(&self, rhs: &mut DMatrix<f64>);
}
