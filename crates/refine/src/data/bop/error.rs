//! What can be wrong with a dataset.

use std::path::{Path, PathBuf};

use prehend_render::ImageError;
use thiserror::Error;

/// A fault of one file of a dataset. Every variant names the file, and the field where there is one.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum DatasetError {
    /// The file or folder does not exist.
    #[error("{}: no such file or folder", file.display())]
    Missing {
        /// The path looked for.
        file: PathBuf,
    },
    /// The file exists and cannot be read.
    #[error("{}: cannot be read: {problem}", file.display())]
    Read {
        /// The path read.
        file: PathBuf,
        /// What the system says.
        problem: String,
    },
    /// The file is not what its name promises: broken JSON, a truncated image, text that is no UTF-8.
    #[error("{}: {problem}", file.display())]
    Malformed {
        /// The path read.
        file: PathBuf,
        /// What is wrong, and where the decoder knows it.
        problem: String,
    },
    /// A file that lists things by key lacks this one.
    #[error("{}: no entry {key:?}", file.display())]
    NoEntry {
        /// The path read.
        file: PathBuf,
        /// The absent key, an image or object id as BOP spells it.
        key: String,
    },
    /// A field is absent, has the wrong type or an impossible value.
    #[error("{}: {field}: {problem}", file.display())]
    Field {
        /// The path read.
        file: PathBuf,
        /// The field's path inside the file, such as `3.bodies[0].cam_R_b2c`.
        field: String,
        /// What is wrong with it.
        problem: String,
    },
    /// Two images of one frame disagree in size.
    #[error(
        "{}: is {}x{} pixels but {} is {}x{}",
        file.display(), size.0, size.1, other.display(), other_size.0, other_size.1
    )]
    ImageSize {
        /// The image that differs.
        file: PathBuf,
        /// Its columns and rows.
        size: (usize, usize),
        /// The image it is compared with.
        other: PathBuf,
        /// The columns and rows of that image.
        other_size: (usize, usize),
    },
    /// No pixel of the mask is set.
    #[error("{}: the mask is empty", file.display())]
    EmptyMask {
        /// The mask.
        file: PathBuf,
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
    /// The split holds no folder for this scene id.
    #[error("{}: no scene {scene_id}", dir.display())]
    UnknownScene {
        /// The split's folder.
        dir: PathBuf,
        /// The id asked for.
        scene_id: u32,
    },
    /// The folder is no BOP dataset: no split with numbered scene folders below it.
    #[error("{}: no scene folders (expected, for example, test/000001)", dir.display())]
    NoScenes {
        /// The dataset's or split's folder.
        dir: PathBuf,
    },
    /// Several splits and none called `test`: the caller must choose.
    #[error("{}: several splits, name one of {}", dir.display(), splits.join(", "))]
    AmbiguousSplit {
        /// The dataset's folder.
        dir: PathBuf,
        /// The splits found.
        splits: Vec<String>,
    },
    /// A file could not be written; nothing of it was left behind.
    #[error("{}: cannot be written: {problem}", file.display())]
    Write {
        /// The path to be written.
        file: PathBuf,
        /// What the system says.
        problem: String,
    },
}

impl DatasetError {
    /// The error of reading `file`, with absence told apart from other failures.
    pub(crate) fn reading(file: &Path, error: &std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::NotFound => Self::Missing { file: file.to_path_buf() },
            _ => Self::Read { file: file.to_path_buf(), problem: error.to_string() },
        }
    }

    /// A [`DatasetError::Malformed`] from anything that can be printed.
    pub(crate) fn malformed(file: &Path, problem: impl ToString) -> Self {
        Self::Malformed { file: file.to_path_buf(), problem: problem.to_string() }
    }
}

impl From<ImageError> for DatasetError {
    fn from(error: ImageError) -> Self {
        match &error {
            ImageError::Io { path, source } => Self::reading(path, source),
            ImageError::Codec { path, source } => Self::malformed(path, source),
            ImageError::Kind { path, expected, found } => {
                Self::malformed(path, format!("expected {expected}, found {found}"))
            }
            ImageError::Scale { path, scale } => {
                Self::malformed(path, format!("{scale} m per depth unit: must be above zero"))
            }
            ImageError::Size { .. } => Self::malformed(Path::new(""), error.to_string()),
        }
    }
}
