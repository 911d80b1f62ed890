//! Linear solves with derivatives that do not go through the solver.
//!
//! A matrix A is factorized once, in `f64`. [`Scalar::solve`](crate::Scalar::solve) reuses its factors for derivatives by the
//! right-hand side: tangents are dx = A⁻¹ db, adjoints b̄ += A⁻ᵀ x̄ (M. B. Giles, "Collected matrix derivative results for
//! forward and reverse mode algorithmic differentiation", 2008). A solve is one operation on the tape, whatever its size.
//!
//! # Matrices with derivatives
//! At the solution x of F(x, p) = 0 with J = ∂F/∂x, the expression x − J⁻¹ F(x, p) has the value x and, with x and J constant,
//! the first derivatives of the solution by p (A. Griewank, A. Walther, "Evaluating derivatives", 2nd ed. 2008, chapter 15). For
//! a linear system F = A(p) x − b(p) and J = A; for roots of other equations see [`implicit`](crate::implicit).
//!
//! ```
//! use nalgebra::{Matrix2, Vector2};
//! use prehend_autodiff::{Scalar, gradient, solve::{SolveError, lu}};
//!
//! /// Deflection of the end of two springs in a row under a unit force.
//! fn deflection<S: Scalar>(stiffness: &[S]) -> Result<S, SolveError> {
//!     let [k, l] = [stiffness[0], stiffness[1]];
//!     let a = Matrix2::new(k + l, -l, -l, l);
//!     let b = Vector2::new(S::zero(), S::one());
//!     let factored = lu(&a.map(S::value))?;
//!     let x = factored.solve(&b.map(S::value))?.map(S::constant);
//!     let excess = a * x - b;
//!     Ok(x[1] - S::solve(&factored, excess.as_slice())[1])
//! }
//!
//! let (value, slopes) = gradient(|k| deflection(k).unwrap(), &[4.0, 2.0]);
//! assert!((value - 0.75).abs() < 1e-15);
//! assert!((slopes[0] + 1.0 / 16.0).abs() < 1e-15 && (slopes[1] + 1.0 / 4.0).abs() < 1e-15);
//! # Ok::<(), SolveError>(())
//! ```
//!
//! [`sparse_lu`] eliminates sparsely with the cargo feature `faer`, which is off by default because faer takes long to compile.

mod condition;
mod dense;
mod error;
mod factored;
mod factors;
#[cfg(feature = "faer")]
mod sparse;

pub use dense::{lu, sparse_lu};
pub use error::SolveError;
pub use factored::Factored;
