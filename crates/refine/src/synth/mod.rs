//! Made-up frames whose truth is known: to try things on, to test with, and to measure methods by.
//!
//! [`default_scene`] is one ready-made frame, [`default_sequence`] many of them; [`generate`] makes whole datasets of [`GraspSnapshot`]s as sensors would see them
//! ([`SensorSettings`]).

mod annotation;
mod dataset;
mod error;
mod folder;
mod frame;
mod generate;
mod grasp;
mod hand_files;
mod models;
mod moment;
mod plan;
mod ready_made;
mod scene_files;
mod seeds;
mod sensor;

pub use dataset::write_dataset;
pub use error::SynthError;
pub use generate::{GraspFailure, Made, generate};
pub use grasp::{Grasp, GraspError, GraspFault, GraspSettings, Grasper, Preshape};
pub use hand_files::HandFiles;
pub use moment::GraspSnapshot;
pub use plan::{Subject, SynthSettings};
pub use ready_made::ready_made_moments;
pub(crate) use sensor::smooth_field;
pub use sensor::{
    BackgroundSettings, CalibrationSettings, ColorSettings, DepthSettings, LightSettings,
    MaskSettings, ModelSettings, SensorSettings, SettingError, TouchSettings, ViewpointSettings,
};
