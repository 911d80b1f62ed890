//! Files: BOP datasets, single frames, what a dataset's objects and hands are loaded into, and what a long run remembers.

mod assets;
pub mod bop;
pub mod frame_file;
pub mod identity;
mod journal;
mod pose;
mod targets;
mod times;
mod workers;

pub use assets::{AssetError, Assets, load_mesh, load_object};
pub use identity::Identity;
pub use journal::{Journal, JournalError};
pub use pose::PlainPose;
pub use targets::{Target, find_targets};
pub use times::{Times, join_times};
pub use workers::Workers;
