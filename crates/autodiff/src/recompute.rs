//! Functions that the sweep computes again instead of having recorded them.

use crate::scalar::Scalar;

/// A function of many numbers, such as a step of a simulation, written once for all scalars.
///
/// [`Scalar::recompute`] applies it. Reverse mode then records one node that keeps the numbers the function was
/// given, and records what is inside only in the sweep, for as long as it takes to go back through it:
///
/// ```
/// use std::convert::Infallible;
/// use prehend_autodiff::{Recompute, Recording, Scalar};
///
/// /// The logistic map, many times.
/// struct Map {
///     times: usize,
/// }
///
/// impl Recompute for Map {
///     type Error = Infallible;
///     fn evaluate<S: Scalar>(&self, x: &[S]) -> Result<Vec<S>, Infallible> {
///         let step = |y: S, _| x[1] * y * (S::one() - y);
///         Ok(vec![(0..self.times).fold(x[0], step)])
///     }
/// }
///
/// let recording = Recording::start();
/// let [x, rate] = recording.variables([0.3, 2.5]);
/// let Ok(y) = Scalar::recompute(Map { times: 100 }, &[x, rate]);
/// assert_eq!(recording.statistics().nodes, 3);
/// // The fixed point is 1 − 1/rate.
/// assert!((recording.gradient(y[0]).wrt(rate) - 1.0 / 6.25).abs() < 1e-12);
/// ```
pub trait Recompute: 'static {
    /// Why there are no results.
    type Error;

    /// The results. It is called again with the same numbers in the sweep, so they may depend on nothing
    /// that changes; should it fail only there, derivatives are NaN.
    ///
    /// # Errors
    /// If there are no results.
    fn evaluate<S: Scalar>(&self, x: &[S]) -> Result<Vec<S>, Self::Error>;
}
