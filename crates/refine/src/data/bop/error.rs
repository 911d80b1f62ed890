//! What can be wrong with a dataset.

use std::path::{Path, PathBuf};

use prehend_render::ImageError;
use thiserror::Error;

/// A fault of one file or folder, which the message names, with the field where there is one.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum DatasetError {
    /// It does not exist.
    #[error("{}: no such file or folder", file.display())]
    Missing {
        /// The path looked for.
        file: PathBuf,
    },
    /// An image that does not exist, though its folder holds something.
    #[error("{}: no such file; the folder has {found}", file.display())]
    NoImage {
        /// The path looked for.
        file: PathBuf,
        /// The first names in its folder.
        found: String,
    },
    /// It is not what it has to be: broken JSON, a field that is absent, of another type or impossible, a dataset without
    /// scenes, a journal of another run; or it cannot be written, and nothing of it is left behind.
    #[error("{}: {problem}", file.display())]
    Unusable {
        /// The file or folder.
        file: PathBuf,
        /// What is wrong, after the field's path inside the file, such as `3.bodies[0].cam_R_b2c`, or the place, where it is known.
        problem: String,
    },
    /// An image that does not decode; the message names the file.
    #[error("{0}")]
    Image(String),
    /// A mask in which nothing is set.
    #[error("{}: the mask is empty", file.display())]
    EmptyMask {
        /// The file.
        file: PathBuf,
    },
    /// A file of detections lacks an object of an image.
    #[error("{}: scene {scene_id} image {im_id}: no detection of object {obj_id} (category_id)", file.display())]
    NoDetection {
        /// The file of detections.
        file: PathBuf,
        /// Scene.
        scene_id: u32,
        /// Image of the scene.
        im_id: u32,
        /// Object.
        obj_id: u32,
    },
    /// A file that lists things by key lacks this one.
    #[error("{}: no entry {key:?}", file.display())]
    NoEntry {
        /// The path read.
        file: PathBuf,
        /// The absent key, an image or object id as BOP spells it.
        key: String,
    },
    /// No pixel of the depth image holds a measurement.
    #[error("{}: every depth is zero", file.display())]
    NoDepth {
        /// The depth image.
        file: PathBuf,
    },
    /// The object id has no model.
    #[error("{}: unknown object id {obj_id}", file.display())]
    UnknownObject {
        /// The model or list of models that was looked for.
        file: PathBuf,
        /// The id asked for.
        obj_id: u32,
    },
}

impl DatasetError {
    /// The error of reading `file`, with absence told apart from other failures.
    pub(crate) fn reading(file: &Path, error: &std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::NotFound => Self::Missing { file: file.into() },
            _ => Self::unusable(file, format!("cannot be read: {error}")),
        }
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
