//! Errors of settings.

use std::error::Error;
use std::path::PathBuf;

/// Why settings are not taken.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SettingsError {
    /// The file cannot be read, or is wrong.
    #[error("{}: {source}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// Error of the system or of the content.
        source: Box<dyn Error + Send + Sync>,
    },
    /// It is no TOML, there is no such setting, or it cannot have this value.
    #[error("{place}: {problem}")]
    Value {
        /// Path of the setting, such as `estimator.patches.sigma`, or path and value; line of a file that is no TOML.
        place: String,
        /// Problem.
        problem: String,
    },
}

impl SettingsError {
    pub(crate) fn value(place: impl Into<String>, problem: impl ToString) -> Self {
        Self::Value { place: place.into(), problem: problem.to_string().trim_end().to_owned() }
    }
}
