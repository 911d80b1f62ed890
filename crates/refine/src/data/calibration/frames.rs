//! The frames of a dataset that a rig is learnt from.

use std::sync::{Mutex, PoisonError};

use nalgebra::Isometry3;

use crate::calibration::CalibrationFrame;
use crate::data::{AssetError, Assets, FrameInput, Target};
use crate::error::RefineError;
use crate::scene::Frame;

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

    /// Joints of the hand, if any frame has one, and columns and rows of images.
    ///
    /// # Errors
    /// If no frame can be read, that of the first.
    pub fn layout(&self) -> Result<(Option<usize>, (usize, usize)), AssetError> {
        let mut assets = self.assets.lock().unwrap_or_else(PoisonError::into_inner);
        let dataset = assets.dataset();
        let has_bodies = |(target, _): &&(Target, Isometry3<f64>)| {
            let frame = dataset.frame(target.scene_id, target.im_id);
            frame.and_then(|frame| frame.bodies()).is_ok_and(|found| !found.bodies.is_empty())
        };
        let (held, free): (Vec<_>, Vec<_>) = self.poses.iter().partition(has_bodies);
        let mut fault = None;
        for (target, _) in held.into_iter().chain(free) {
            match assets.load(&target, &[]) {
                Ok(FrameInput { frame: Frame { camera, hand, .. }, .. }) => {
                    let joints = hand.map(|measured| measured.hand.tree.joint_names().len());
                    return Ok((joints, (camera.width, camera.height)));
                }
                Err(error) => {
                    let error = Box::new(error);
                    fault.get_or_insert(AssetError::Frame { target, error });
                }
            }
        }
        Err(fault.unwrap_or(AssetError::Refine(RefineError::NothingFits)))
    }

    /// The frame of that index, with its object at `pose`.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn load(
        &self,
        index: usize,
        pose: &Isometry3<f64>,
    ) -> Result<CalibrationFrame, AssetError> {
        let target = &self.poses[index].0;
        let input = {
            let mut assets = self.assets.lock().unwrap_or_else(PoisonError::into_inner);
            assets.load(target, &[])?
        };
        let observation = input.frame;
        let obj_id = target.obj_id;
        Ok(CalibrationFrame { frame: observation, obj_id, initial: *pose, is_refined: false })
    }
}
