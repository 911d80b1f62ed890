//! What a factorization can do.

use nalgebra::DMatrix;

/// What a factorization is asked for: solves with the matrix and its transpose, in place, for any number
/// of right-hand sides.
pub(super) trait Factors: Send + Sync + 'static {
    fn solve(&self, rhs: &mut DMatrix<f64>);
    fn solve_transpose(&self, rhs: &mut DMatrix<f64>);
}
