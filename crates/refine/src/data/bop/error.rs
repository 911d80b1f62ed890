//! Errors of datasets.

use std::path::{Path, PathBuf};

use prehend_render::ImageError;
use thiserror::Error;

/// A fault of one file or folder, which the message names, with the field where there is one.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum DatasetError {
    /// Something that some datasets lack: a file, a folder or a mesh, the entry of an image or object, a measurement of depth.
    #[error("{}: {problem}", file.display())]
    Missing {
        /// The path looked for, or that of the file that lacks it.
        file: PathBuf,
        /// Name of the part that is missing, and why, where that is known.
        problem: String,
    },
    /// An object without a mask in an image: no file of one, or one in which nothing is set, or no detection.
    #[error("{}: {problem}", file.display())]
    NoMask {
        /// The mask, or the file of detections.
        file: PathBuf,
        /// Name of the part that is missing, and why, where that is known.
        problem: String,
    },
    /// It is not what it has to be: an image that is absent from a folder of others, broken JSON, a field that is absent, of another type or impossible, a dataset without
    /// scenes, a journal of another run; or it cannot be written, and nothing of it is left behind.
    #[error("{}: {problem}", file.display())]
    Unusable {
        /// The file or folder.
        file: PathBuf,
        /// Problem, after the field's path inside the file, such as `3.bodies[0].cam_R_b2c`, or the place, where it is known.
        problem: String,
    },
    /// An image that does not decode; the message names the file.
    #[error("{0}")]
    Image(String),
}

/// Problem of a file that is absent.
pub(super) const ABSENT: &str = "no such file or folder";

impl DatasetError {
    /// The error of reading `file`, with absence told apart from other failures.
    pub(crate) fn reading(file: &Path, error: &std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::NotFound => Self::absent(file),
            _ => Self::unusable(file, format!("cannot be read: {error}")),
        }
    }

    /// The error that there is no `file`.
    pub(crate) fn absent(file: &Path) -> Self {
        Self::missing(file, ABSENT)
    }

    /// A [`DatasetError::NoMask`].
    pub(crate) fn no_mask(file: &Path, problem: impl Into<String>) -> Self {
        Self::NoMask { file: file.into(), problem: problem.into() }
    }

    /// A [`DatasetError::Missing`].
    pub(crate) fn missing(file: &Path, problem: impl Into<String>) -> Self {
        Self::Missing { file: file.into(), problem: problem.into() }
    }

    /// The error of writing `file`, from anything that can be printed.
    pub(crate) fn writing(file: &Path, problem: impl ToString) -> Self {
        Self::unusable(file, format!("cannot be written: {}", problem.to_string()))
    }

    /// A [`DatasetError::Unusable`] from anything that can be printed.
    pub(crate) fn unusable(file: &Path, problem: impl ToString) -> Self {
        Self::Unusable { file: file.into(), problem: problem.to_string() }
    }

    /// An error about a field of `file`, from anything that can be printed.
    pub(crate) fn field(file: &Path, field: &str, problem: impl ToString) -> Self {
        Self::unusable(file, format!("{field}: {}", problem.to_string()))
    }
}

/// Result of `read`, if its file and entry are there.
pub(crate) fn present<T>(read: Result<T, DatasetError>) -> Result<Option<T>, DatasetError> {
    match read {
        Err(DatasetError::Missing { .. }) => Ok(None),
        read => read.map(Some),
    }
}

impl From<ImageError> for DatasetError {
    fn from(error: ImageError) -> Self {
        match &error {
            ImageError::Io { path, source } => Self::reading(path, source),
            other => Self::Image(other.to_string()),
        }
    }
}

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
