//! A rig: errors of its camera, its hand and its models that all of its frames have in common.
//!
//! A [`Rig`] corrects frames and models, and states how well they are known then ([`Fused::with_rig`](crate::strategy::Fused::with_rig)).
//! [`Calibrator`](crate::calibration::Calibrator) finds it.

mod correction;
mod parameters;

pub use self::parameters::{Play, Rig};
