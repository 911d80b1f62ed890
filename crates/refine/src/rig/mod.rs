//! A rig, learnt from its own frames: what is wrong with its camera, hand and models is so in every frame.
//!
//! A [`Calibrator`] finds it, pass by pass over frames in which the poses of objects are roughly known; a [`Rig`] corrects frames and models
//! by it, and says how well they are known then ([`Frame::with_rig`](crate::Frame::with_rig)).

mod calibrator;
mod correction;
mod deviation;
mod file;
mod frames;
mod information;
mod parameters;
mod pass;
mod passes;
mod residuals;
mod settings;
mod views;

pub use self::calibrator::{CalibrationFrame, Calibrator};
pub use self::deviation::SurfaceDeviation;
pub use self::frames::CalibrationFrames;
pub use self::parameters::{Play, Rig};
pub use self::pass::{Pass, Visit};
pub use self::passes::{Calibrated, Passes};
pub use self::residuals::{FrameResiduals, Residuals, SensorResidual};
pub use self::settings::CalibratorSettings;
