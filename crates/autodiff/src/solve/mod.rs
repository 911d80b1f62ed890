//! Linear solves with derivatives that do not go through the solver.
//!
//! A matrix is factorized once, in `f64`, and both derivatives of x = A⁻¹ b reuse its factors: tangents
//! are dx = A⁻¹ (db − dA x); adjoints are λ = A⁻ᵀ x̄, b̄ += λ, Ā −= λ xᵀ (M. B. Giles, "Collected matrix
//! derivative results for forward and reverse mode algorithmic differentiation", 2008).
//! A solve is one operation on the tape, whatever its size.
//!
//! ```
//! use nalgebra::{Matrix2, Vector2};
//! use prehend_autodiff::{Operand, gradient, solve::{SolveError, lu}};
//!
//! // The same line runs with f64, forward and reverse mode.
//! fn deflection<S: Operand>(stiffness: &[S]) -> Result<S, SolveError> {
//!     let [k, l] = [stiffness[0], stiffness[1]];
//!     let x = lu(&Matrix2::new(k + l, -l, -l, l))?.solve(&Vector2::new(S::zero(), S::one()))?;
//!     Ok(x[1])
//! }
//!
//! // Two springs in a row: 1/k + 1/l.
//! let (value, slopes) = gradient(|k| deflection(k).unwrap(), &[4.0, 2.0]);
//! assert!((value - 0.75).abs() < 1e-15 && value == deflection(&[4.0, 2.0])?);
//! assert!((slopes[0] + 1.0 / 16.0).abs() < 1e-15 && (slopes[1] + 1.0 / 4.0).abs() < 1e-15);
//! # Ok::<(), SolveError>(())
//! ```
//!
//! `SparseSolver` does the same for a sparse matrix, whose pattern is analyzed once for all the matrices
//! that share it. It needs the cargo feature `faer`, which is off by default because faer takes long to
//! compile. [`sparse_lu`] uses it if it is there.

mod condition;
mod dense;
mod error;
mod factored;
mod factors;
mod pattern;
#[cfg(feature = "faer")]
mod sparse;

pub use dense::{lu, sparse_lu};
pub use error::SolveError;
pub use factored::Factored;
#[cfg(feature = "faer")]
pub use sparse::SparseSolver;
