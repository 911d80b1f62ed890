//! Small optimizers for differentiable simulation, on plain `&[f64]` parameters.
//!
//! | the objective is | use |
//! |---|---|
//! | a sum of squared residuals, with up to a few hundred parameters | [`LevenbergMarquardt`] |
//! | anything else: noisy, kinked or badly scaled, as through contacts | [`Adam`] |
//!
//! For anything more (quasi-Newton methods, bounds) [`gradient`](crate::gradient) plugs into a general
//! optimization library; `benches/peers/autodiff/examples/argmin_lbfgs.rs` does so.
//!
//! An objective returns its value and gradient, or its [`NormalEquations`], at the parameters that it
//! is given:
//!
//! ```
//! use prehend_autodiff::optimize::{Adam, LevenbergMarquardt, NormalEquations};
//! use prehend_autodiff::{Scalar, gradient};
//!
//! fn residuals<S: Scalar>(x: &[S]) -> Vec<S> {
//!     vec![x[0] - S::constant(3.0), x[0] * x[1] - S::constant(6.0)]
//! }
//! fn energy<S: Scalar>(x: &[S]) -> S {
//!     residuals(x).into_iter().fold(S::zero(), |sum, r| sum + r * r)
//! }
//!
//! let start = [1.0, 1.0];
//! let slow = Adam { rate: 0.1, ..Adam::default() }.minimize(&start, |x| gradient(energy, x))?;
//! let fast = LevenbergMarquardt::default()
//!     .minimize(&start, |x| NormalEquations::forward::<2>(residuals, x))?;
//! for x in [slow.parameters, fast.parameters] {
//!     assert!((x[0] - 3.0).abs() < 1e-6 && (x[1] - 2.0).abs() < 1e-6);
//! }
//! # Ok::<(), prehend_autodiff::optimize::OptimizeError>(())
//! ```
//!
//! Poses and other parameters on a manifold are a [`LeastSquares`] problem with a retraction of its own
//! ([`LevenbergMarquardt::minimize_on`]); for the other methods rotations enter as exponential coordinates, for instance
//! `so3_exp(x) * reference` with [`so3_exp`](crate::lie::so3_exp), which are regular up to an angle of 2π from the reference.
//!
//! An iteration is one trial step and one evaluation of the objective. A trial at which the value or a
//! derivative is not finite is never taken, and the next one is shorter.

mod adam;
mod criteria;
mod error;
mod iterate;
mod least_squares;
mod normal_equations;
mod problem;
mod report;
#[cfg(test)]
mod test_problems;

pub use adam::Adam;
pub use criteria::Criteria;
pub use error::OptimizeError;
pub use least_squares::{LevenbergMarquardt, Solved};
pub use normal_equations::NormalEquations;
pub use problem::{LeastSquares, QuadraticModel};
pub use report::{Iteration, Outcome, Stop};
