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
mod error;
mod files;
mod frame;
mod ground_truth;
mod json;
mod models;
mod numbers;
mod optics;
mod pose;
mod results;
mod touch;

pub use bodies::{Body, BodyKind, SceneBodies};
pub(crate) use bodies::{BodyEntry, read_bodies, sigmas};
pub use dataset::{Dataset, DatasetScene};
pub use detections::Detections;
pub use error::DatasetError;
pub(crate) use error::{Origin, present};
pub use files::{check_writable, create_folder, write_atomically};
pub(crate) use files::{lock, open_locked, read_bytes, read_text};
pub use frame::DatasetImage;
pub use ground_truth::{GroundTruth, TrueObject};
pub(crate) use json::{UniqueMap, read_json};
pub(crate) use models::extent_to_bop;
pub use models::{ModelInfo, Models, write_symmetries};
pub use numbers::LengthUnit;
pub(crate) use numbers::{Intrinsics, Lens, NonNegative, Numbers, Positive, Real};
#[cfg(feature = "mcap")]
pub(crate) use optics::drop_saturated;
pub(crate) use optics::{DepthCamera, LensedCamera, Optics, SharedOptics, check_size};
pub use pose::pose_from_matrix;
pub(crate) use pose::{FramePose, Rotation, rotation_to_row_major, translation_to_mm};
pub use results::{
    ReadResults, ResultRow, ResultsWriter, read_hypotheses, read_results, share_image_times,
    write_results,
};
pub(crate) use touch::TactileEntry;
pub use touch::{Tactile, TactileReading};
