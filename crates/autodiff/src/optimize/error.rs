//! Why an optimization could not run.

use thiserror::Error;

/// Input that no optimization can start or continue with.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum OptimizeError {
    /// The start holds no parameters.
    #[error("there are no parameters to optimize")]
    NoParameters,
    /// A parameter of the start is infinite or NaN.
    #[error("parameter {index} of the start is not finite")]
    StartNotFinite {
        /// Which one.
        index: usize,
    },
    /// The value, or one of the derivatives, is infinite or NaN at the start.
    #[error("the objective or its derivative is not finite at the start")]
    ObjectiveNotFinite,
    /// The objective's gradient does not fit the parameters.
    #[error("the gradient has {found} entries for {expected} parameters")]
    GradientLength {
        /// Number of parameters.
        expected: usize,
        /// Entries of the gradient.
        found: usize,
    },
    /// The matrix of the normal equations does not fit the parameters.
    #[error("the matrix of the normal equations is {rows} × {columns} for {expected} parameters")]
    MatrixShape {
        /// Number of parameters.
        expected: usize,
        /// Rows of the matrix.
        rows: usize,
        /// Columns of the matrix.
        columns: usize,
    },
    /// A problem did not answer for each of the points that it was asked about.
    #[error("{found} linearizations for {expected} points")]
    Answers {
        /// Number of points.
        expected: usize,
        /// Linearizations given.
        found: usize,
    },
    /// A setting is outside its range.
    #[error("`{name}` is {value}, but must be {range}")]
    Setting {
        /// Name of the field.
        name: &'static str,
        /// Value of the field.
        value: f64,
        /// Range of values that it may have, such as `at least 0`.
        range: &'static str,
    },
}

/// Refuses a setting that is not in its range.
pub(super) fn check_setting(
    name: &'static str,
    value: f64,
    range: &'static str,
    inside: bool,
) -> Result<(), OptimizeError> {
    if inside { Ok(()) } else { Err(OptimizeError::Setting { name, value, range }) }
}
