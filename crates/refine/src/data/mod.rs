//! Files: BOP datasets, single frames, what a dataset's objects and hands are loaded into, and what a long run keeps; and
//! what scores and made-up datasets share: contact.

mod assets;
mod bodies;
pub mod bop;
#[cfg(feature = "cli")]
mod cache;
mod calibration;
mod contact;
pub mod details;
mod frame_file;
pub mod identity;
mod journal;
mod mask_source;
#[cfg(feature = "mcap")]
pub mod mcap;
mod pose;
mod rig_file;
mod robots;
mod targets;
mod times;

pub use assets::{AssetError, Assets, FrameInput, load_mesh};
pub use bop::pose_from_matrix;
#[cfg(feature = "cli")]
pub use cache::user_cache;
pub use calibration::{Calibrated, CalibrationFrames};
pub use contact::ContactModel;
pub(crate) use frame_file::FrameParts;
pub use frame_file::load_frame_file;
pub use identity::Identity;
pub use journal::Journal;
pub use mask_source::MaskSource;
pub use pose::PlainPose;
pub(crate) use robots::load_robot;
pub use targets::find_targets;
pub(crate) use targets::listed_targets;
pub use times::{timed_methods, write_times};

pub use crate::scene::Target;
