//! Places in files of what was read from them.

use std::path::{Path, PathBuf};

use super::error::DatasetError;

/// Field of a file that something was read from, for errors about it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Origin {
    file: PathBuf,
    field: String,
}

impl Origin {
    pub(crate) fn new(file: &Path, field: impl Into<String>) -> Self {
        Self { file: file.to_owned(), field: field.into() }
    }

    /// An error about a field of it, or about all of it if `field` is empty.
    pub(crate) fn fault(&self, field: &str, problem: impl ToString) -> DatasetError {
        let field = format!("{}.{field}", self.field);
        DatasetError::field(&self.file, field.trim_matches('.'), problem)
    }
}
