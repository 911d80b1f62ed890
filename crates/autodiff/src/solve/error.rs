//! Errors of linear systems.

/// A linear system that cannot be solved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SolveError {
    /// The matrix has more rows than columns, or fewer.
    #[error("a matrix of {rows} rows and {columns} columns is not square")]
    NotSquare {
        /// Rows of the matrix.
        rows: usize,
        /// Columns of the matrix.
        columns: usize,
    },
    /// A right-hand side has more rows than the matrix, or fewer.
    #[error("{expected} rows of the right-hand side are needed, {found} were given")]
    Length {
        /// How many the matrix has.
        expected: usize,
        /// How many there were.
        found: usize,
    },
    /// An entry of a sparse matrix lies outside the matrix.
    #[error("entry ({row}, {column}) lies outside a matrix of size {size}")]
    OutOfBounds {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// Rows, and columns, of the matrix.
        size: usize,
    },
    /// The matrix, a right-hand side or the solution holds an infinity or NaN.
    #[error("the {0} is not finite")]
    NotFinite(&'static str),
    /// The matrix is singular, or too close to it for its solution to mean anything.
    #[error("the matrix is singular to working precision (condition number about {condition:.1e})")]
    Singular {
        /// Estimated condition number in the best units of unknowns and equations; infinite when a pivot is zero.
        condition: f64,
    },
    /// The factorization needs more memory than there is, or more entries than can be counted.
    #[error("the matrix is too large to factorize")]
    TooLarge,
}
