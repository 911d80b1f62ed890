//! Calibration of a rig from the frames of a dataset.

mod frames;
mod passes;

pub use self::frames::CalibrationFrames;
pub use self::passes::{Calibrated, Passes};
