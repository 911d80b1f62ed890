//! Why a dataset could not be made.

use std::path::PathBuf;

use thiserror::Error;

use crate::data::bop::DatasetError;
use crate::data::{AssetError, JournalError};

/// Why a dataset could not be made.
#[derive(Debug, Error)]
pub enum SynthError {
    /// The folder holds a dataset that was begun with other settings.
    #[error(
        "{}: {setting} was {stored} when this dataset was begun, and now is {given}: give the same settings, or another folder",
        file.display()
    )]
    OtherSettings {
        /// Where the dataset's settings are kept.
        file: PathBuf,
        /// The first setting that differs, such as `sensor.depth.noise`.
        setting: String,
        /// Its value in the file, as JSON.
        stored: String,
        /// The value given now.
        given: String,
    },
    /// The folder holds something else.
    #[error("{}: is not empty and has no synth.json: no dataset of ours to go on with", dir.display())]
    Occupied {
        /// The folder.
        dir: PathBuf,
    },
    /// A number that must be above zero is not.
    #[error("{setting} must be above zero")]
    Zero {
        /// The setting.
        setting: &'static str,
    },
    /// Two objects have the same number.
    #[error("two objects have the number {obj_id}")]
    SameObject {
        /// The number.
        obj_id: u32,
    },
    /// An object cannot be used in this hand at all.
    #[error("object {obj_id}: {reason}")]
    Object {
        /// The object's number.
        obj_id: u32,
        /// What is wrong.
        reason: String,
    },
    /// A file cannot be read or written, or an object prepared.
    #[error(transparent)]
    Asset(#[from] AssetError),
    /// The journal of the frames that are done cannot be used.
    #[error(transparent)]
    Journal(#[from] JournalError),
}

impl From<DatasetError> for SynthError {
    fn from(error: DatasetError) -> Self {
        Self::Asset(error.into())
    }
}
