//! A rig, learnt from its own frames: what is wrong with its camera, hand and models is so in every frame.
//!
//! A [`Calibrator`] finds it, pass by pass over frames in which the poses of objects are roughly known; a [`Rig`] corrects frames and models
//! by it, and says how well they are known then ([`Frame::with_rig`](crate::Frame::with_rig)).

mod calibrator;
mod deviation;
mod file;
mod information;
mod parameters;

pub use self::calibrator::{CalibrationFrame, Calibrator, CalibratorSettings, Pass, Visit};
pub use self::deviation::SurfaceDeviation;
pub use self::parameters::{Play, Rig};
