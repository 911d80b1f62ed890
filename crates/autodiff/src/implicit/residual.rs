//! The equation whose solution is differentiated.

use std::sync::Arc;

use crate::Scalar;

/// An equation F(x, p) = 0 with as many components as unknowns x.
pub trait Residual {
    /// F(x, p): one number for each of `x`.
    fn residual<S: Scalar>(&self, x: &[S], p: &[S]) -> Vec<S>;
}

impl<R: Residual> Residual for &R {
    fn residual<S: Scalar>(&self, x: &[S], p: &[S]) -> Vec<S> {
        (**self).residual(x, p)
    }
}

/// An equation with much data is shared with the tape rather than copied.
impl<R: Residual> Residual for Arc<R> {
    fn residual<S: Scalar>(&self, x: &[S], p: &[S]) -> Vec<S> {
        (**self).residual(x, p)
    }
}
