//! Errors of implicit equations.

use crate::solve::SolveError;

/// A root that was not found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ImplicitError {
    /// The equation does not have as many components as there are unknowns.
    #[error("{found} equations for {unknowns} unknowns")]
    Equations {
        /// Unknowns that were given.
        unknowns: usize,
        /// Components of the residual.
        found: usize,
    },
    /// The Jacobian by the unknowns is of another size than they.
    #[error("a Jacobian of size {found} for {unknowns} unknowns")]
    Jacobian {
        /// Unknowns that were given.
        unknowns: usize,
        /// Rows, and columns, of the Jacobian.
        found: usize,
    },
    /// Newton's method came to a halt.
    #[error(
        "Newton's method did not converge: after {iterations} iterations a step has length {step:e}"
    )]
    NotConverged {
        /// Iterations taken.
        iterations: usize,
        /// Euclidean length of the residual.
        residual: f64,
        /// Euclidean length of the last Newton step.
        step: f64,
    },
    /// The Jacobian by the unknowns is singular, or it or the residual is not finite.
    #[error("the equation cannot be linearized: {0}")]
    Solve(#[from] SolveError),
}
