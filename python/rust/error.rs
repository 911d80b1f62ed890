//! Errors as exceptions.

use std::fmt::Display;

use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

create_exception!(
    prehend,
    Error,
    PyValueError,
    "What prehend says of input that cannot be, or of a computation that failed."
);

/// An exception with the text of an error.
pub(crate) trait Raise<T> {
    /// The value, or the exception.
    fn raise(self) -> PyResult<T>;
}

impl<T, E: Display> Raise<T> for Result<T, E> {
    fn raise(self) -> PyResult<T> {
        self.map_err(|error| Error::new_err(error.to_string()))
    }
}

/// An exception with a text of one's own.
pub(crate) fn wrong(text: impl Into<String>) -> PyErr {
    Error::new_err(text.into())
}
