//! BOP datasets: what an estimator may read ([`Dataset`]), the truth a scorer may read
//! ([`GroundTruth`]), and results files ([`read_results`], [`write_results`]).
//!
//! Files are in millimeters; everything these modules return is in meters. Two files extend the
//! BOP layout: `scene_bodies.json` (gravity, and the known robot and other bodies) and
//! `scene_tactile.json` (what is felt). A file is read when something of it is first asked for, so
//! a missing or broken one disturbs only what needs it.

mod arrival;
mod bodies;
mod dataset;
mod detections;
mod entries;
mod error;
mod files;
mod frame;
mod ground_truth;
mod json;
mod lens;
mod models;
mod models_info;
mod one_camera;
mod pose;
mod results;
mod rivals;
mod touch;
mod unique;
mod visibility;

pub use arrival::Stamp;
pub use bodies::{Body, BodyKind, SceneBodies};
pub(crate) use bodies::{KindName, body_sigmas, positions};
pub use dataset::{Dataset, Scene};
pub use detections::Detections;
pub use error::DatasetError;
pub use files::{check_writable, create_folder, write_atomically};
pub(crate) use files::{lock, read_bytes, read_text};
pub use frame::Frame;
pub use ground_truth::{GroundTruth, TrueObject};
pub(crate) use json::{
    Numbers, Positive, Real, Rotation, field_fault, read_json, read_json_in_range,
};
pub(crate) use lens::Lens;
pub use models::{ModelInfo, Models};
pub(crate) use models_info::extent_to_bop;
pub use models_info::write_symmetries;
pub(crate) use pose::{
    require_in_range, rotation_from_row_major, rotation_to_row_major, translation_from_mm,
    translation_to_mm,
};
pub use results::{
    ReadResults, ResultRow, ResultsWriter, read_results, share_image_times, write_results,
};
pub use rivals::read_rivals;
pub(crate) use touch::TactileEntry;
pub use touch::{Tactile, TactileReading, UNITS_PER_NEWTON};
pub(crate) use unique::parse_json;
