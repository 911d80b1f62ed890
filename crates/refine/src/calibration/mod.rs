//! Calibration of a [`Rig`](crate::rig::Rig) from its own frames: a [`Calibrator`] finds it, pass by pass over frames in which the poses of objects are
//! roughly known.

mod calibrator;
mod information;
mod pass;
mod residuals;
mod settings;
mod views;

pub use self::calibrator::{CalibrationFrame, Calibrator};
pub use self::pass::{Pass, Visit};
pub use self::residuals::{FrameResiduals, Residuals, SensorResidual};
pub use self::settings::CalibratorSettings;
