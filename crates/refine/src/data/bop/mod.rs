//! BOP datasets: what an estimator may read ([`Dataset`]), the truth a scorer may read
//! ([`GroundTruth`]), and results files ([`read_results`], [`write_results`]).
//!
//! Files are in millimeters; everything these modules return is in meters. Two files extend the
//! BOP layout: `scene_bodies.json` (gravity, and the known robot and other bodies) and
//! `scene_tactile.json` (what is felt). A file is read when something of it is first asked for, so
//! a missing or broken one disturbs only what needs it.

mod arrival;
mod atomic;
mod bodies;
mod dataset;
mod error;
mod frame;
mod ground_truth;
mod json;
mod lens;
mod models;
mod models_info;
mod pose;
mod results;
mod rivals;
mod touch;
mod visibility;

pub use arrival::Stamp;
pub use atomic::{check_writable, create_folder, write_atomically};
pub use bodies::{Body, BodyKind, SceneBodies};
pub(crate) use bodies::{KindName, body_sigmas};
pub use dataset::{Dataset, Scene};
pub use error::DatasetError;
pub use frame::Frame;
pub use ground_truth::{GroundTruth, TrueObject};
pub(crate) use json::{Numbers, Positive, Rotation, field_fault, read_json};
pub(crate) use lens::{Lens, RemapCache};
pub use models::{ModelInfo, Models};
pub use models_info::write_symmetries;
pub(crate) use models_info::{diameter, extent_to_bop};
pub(crate) use pose::{
    rotation_from_row_major, rotation_to_row_major, translation_from_mm, translation_to_mm,
};
pub use results::{
    ReadResults, ResultRow, ResultsWriter, read_results, share_image_times, write_results,
};
pub use rivals::read_rivals;
pub(crate) use touch::TactileEntry;
pub use touch::{Tactile, TactileReading, UNITS_PER_NEWTON};
