//! Studies: methods run on a dataset with ground truth from initial poses at several levels of noise.
//!
//! A [`Design`] says what is compared; a [`Runner`] makes a [`Record`] of each frame and method; a [`StudyFile`] keeps them as
//! one CSV table, from which an interrupted study resumes. [`tables`] has means and medians beside the published figures;
//! intervals, contrasts, calibrations and plots are made of the CSV file by `python/studies`.

mod design;
mod file;
mod initial_pose;
mod kind;
mod page;
mod prediction;
mod published;
mod record;
mod runner;
mod sweep;
mod tables;

pub use design::Design;
pub use file::StudyFile;
pub use initial_pose::InitialPose;
pub use kind::Kind;
pub use page::write_page;
pub use record::{Key, Record};
pub use runner::Runner;
pub use sweep::Sweep;
pub use tables::tables;
