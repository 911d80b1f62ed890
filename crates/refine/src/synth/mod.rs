//! Synthetic frames whose truth is known: to try things on, to test with, and to measure methods by.
//!
//! [`Grasper`] makes physically settled grasps; [`generate`] makes whole datasets of [`GraspSnapshot`]s as sensors would
//! measure them ([`SensorSettings`]); [`write_dataset`] writes given scenes.

mod annotation;
mod dataset;
mod error;
mod files;
mod frame;
mod generate;
mod grasp;
mod hand_files;
mod plan;
mod pose_noise;
mod sensor;
mod settings;

pub use dataset::write_dataset;
pub use error::SynthError;
pub use frame::simulate_frame;
pub use generate::{DatasetSummary, GraspFailure, generate};
pub use grasp::{Grasp, GraspSettings, GraspSnapshot, Grasper};
pub use hand_files::HandFiles;
pub use plan::{SynthObject, SynthSettings};
pub use pose_noise::NoiseLevel;
#[cfg(feature = "cli")]
pub(crate) use pose_noise::random_direction;
#[cfg(feature = "cli")]
pub(crate) use sensor::smooth_field;
pub use sensor::{FilmSettings, SensorSettings};
