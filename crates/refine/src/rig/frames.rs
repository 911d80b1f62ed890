//! The frames of a dataset that a rig is learnt from.

use std::sync::{Mutex, PoisonError};

use nalgebra::Isometry3;

use super::calibrator::CalibrationFrame;
use crate::data::{AssetError, Assets, FrameInput, Sensor, Target};
use crate::scene::Observation;

/// Frames of a dataset, each with a rough pose (object → camera \[m\]); they are read when they are visited.
pub struct CalibrationFrames<'a> {
    /// What each shows, and where that is said to be.
    pub poses: Vec<(Target, Isometry3<f64>)>,
    assets: Mutex<Assets<'a>>,
}

impl<'a> CalibrationFrames<'a> {
    /// Of these objects and hands. Masks may be missing where `assets` has them [optional](Assets::with_optional_masks).
    pub fn new(assets: Assets<'a>, poses: Vec<(Target, Isometry3<f64>)>) -> Self {
        Self { poses, assets: Mutex::new(assets) }
    }

    /// Joints of the hand, and columns and rows of the images, of the first frame that can be read.
    ///
    /// # Errors
    /// What is wrong with the first frame if none can be read, or that there is no hand.
    pub fn layout(&self) -> Result<(usize, (usize, usize)), AssetError> {
        let mut assets = self.assets.lock().unwrap_or_else(PoisonError::into_inner);
        let mut fault = None;
        for (target, _) in &self.poses {
            match assets.load(target, &[Sensor::Hand]) {
                Ok(FrameInput {
                    observation: Observation { camera, .. },
                    hand: Some(hand),
                    ..
                }) => {
                    return Ok((hand.tree.joint_names().len(), (camera.width, camera.height)));
                }
                Ok(_) => {}
                Err(error) => {
                    let (target, error) = (*target, Box::new(error));
                    fault.get_or_insert(AssetError::Frame { target, error });
                }
            }
        }
        Err(fault.unwrap_or(AssetError::NoHand))
    }

    /// The frame of that index, with its object at `pose`.
    ///
    /// # Errors
    /// If it cannot be read, or nothing is known of a hand.
    pub fn load(
        &self,
        index: usize,
        pose: &Isometry3<f64>,
    ) -> Result<CalibrationFrame, AssetError> {
        let target = &self.poses[index].0;
        let input = {
            let mut assets = self.assets.lock().unwrap_or_else(PoisonError::into_inner);
            assets.load(target, &[Sensor::Hand])?
        };
        let FrameInput { observation, hand, .. } = input;
        let (obj_id, hand) = (target.obj_id, hand.ok_or(AssetError::NoHand)?);
        Ok(CalibrationFrame { observation, obj_id, hand, initial: *pose, is_refined: false })
    }
}
