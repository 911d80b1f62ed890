//! One frame at a time, for those who make many and keep none.

use std::sync::Arc;

use nalgebra::Isometry3;
use prehend_geometry::SplitMix64;

use super::error::SynthError;
use super::grasp::GraspSnapshot;
use super::plan::SynthSettings;
use super::sensor::SensorRig;
use crate::scene::{Frame, Hand, Object};

/// Frame of `moment` as sensors would measure it, and the true pose object → camera \[m\]. `seed` decides view, light and all faults, also those that
/// last through a grasp in a dataset; the lens is a pinhole.
///
/// # Errors
/// If joints or forces of `moment` are not those of `hand`.
pub fn simulate_frame(
    settings: &SynthSettings,
    object: &Object,
    hand: &Arc<Hand>,
    moment: &GraspSnapshot,
    seed: u64,
) -> Result<(Frame, Isometry3<f64>), SynthError> {
    hand.check_joints(&moment.joints)?;
    hand.check_forces(&moment.taxel_forces)?;
    let mut noise = SplitMix64::new(seed);
    let rig = SensorRig::new(settings, object, hand, None, &mut noise);
    let shot = rig.capture(moment, None, &mut noise)?;
    Ok((shot.told, shot.truth))
}
