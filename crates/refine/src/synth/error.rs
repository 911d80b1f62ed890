//! Reason that a grasp or a dataset could not be made.

use prehend_render::DistortionError;
use prehend_sim::SimulationError;
use thiserror::Error;

use crate::data::AssetError;

/// Reason that a grasp or a dataset could not be made.
#[derive(Debug, Error)]
pub enum SynthError {
    /// An argument or setting that is out of its range, a folder that holds something else, a hand or an object that cannot be used, or an attempt that
    /// led to no grasp within the settings: another seed may do better.
    #[error("{0}")]
    Refused(String),
    /// The simulation failed.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The lens cannot make an image.
    #[error(transparent)]
    Lens(#[from] DistortionError),
    /// A file cannot be read or written, or an object or a hand prepared.
    #[error(transparent)]
    Asset(AssetError),
}

impl<E: Into<AssetError>> From<E> for SynthError {
    fn from(error: E) -> Self {
        Self::Asset(error.into())
    }
}

impl SynthError {
    pub(super) fn refused(problem: impl ToString) -> Self {
        Self::Refused(problem.to_string())
    }
}
