//! Reason that a dataset could not be made.

use std::path::PathBuf;

use prehend_render::DistortionError;
use thiserror::Error;

use crate::data::AssetError;
use crate::data::bop::DatasetError;

/// Reason that a dataset could not be made.
#[derive(Debug, Error)]
pub enum SynthError {
    /// The folder holds a dataset that was begun with other settings.
    #[error("{}: {difference}: give the same settings, or another folder", file.display())]
    OtherSettings {
        /// File of the dataset's settings.
        file: PathBuf,
        /// The first setting that differs, and both its values.
        difference: String,
    },
    /// This folder holds something else.
    #[error("{}: is not empty and has no synth.json: no dataset of ours to go on with", .0.display())]
    Occupied(PathBuf),
    /// There are no objects, two have the same number, or one cannot be used in this hand at all.
    #[error("{0}")]
    Argument(String),
    /// The lens cannot make an image.
    #[error(transparent)]
    Lens(#[from] DistortionError),
    /// A file cannot be read or written, or an object prepared.
    #[error(transparent)]
    Asset(#[from] AssetError),
}

impl From<DatasetError> for SynthError {
    fn from(error: DatasetError) -> Self {
        Self::Asset(error.into())
    }
}
