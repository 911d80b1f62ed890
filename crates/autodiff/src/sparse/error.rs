//! What can be wrong with a pattern or a Jacobian.

/// Why a pattern or a Jacobian was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SparseError {
    /// A pattern has an entry beyond the last column.
    #[error("row {row} of the pattern has an entry in column {column} of {columns}")]
    NoSuchColumn {
        /// The row (from 0).
        row: usize,
        /// The column (from 0) that does not exist.
        column: usize,
        /// Number of columns.
        columns: usize,
    },
    /// There are not as many inputs as columns.
    #[error("{found} inputs, but the pattern has {expected} columns")]
    InputCount {
        /// Columns of the pattern.
        expected: usize,
        /// Inputs given.
        found: usize,
    },
    /// There are not as many outputs as rows.
    #[error("{found} outputs, but the pattern has {expected} rows")]
    OutputCount {
        /// Rows of the pattern.
        expected: usize,
        /// Outputs of the function.
        found: usize,
    },
    /// The pattern lacks an entry that is not zero.
    #[error("the derivative of output {row} has an entry that the pattern lacks")]
    RowOutsidePattern {
        /// The row (from 0).
        row: usize,
    },
    /// The pattern lacks an entry that is not zero.
    #[error("the derivative by input {column} has an entry that the pattern lacks")]
    ColumnOutsidePattern {
        /// The column (from 0).
        column: usize,
    },
}
