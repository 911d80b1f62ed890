//! Calibration of a rig from the frames of a dataset: passes over them, window by window, until the rig is settled.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use nalgebra::Isometry3;

use crate::calibration::{CalibrationFrame, Calibrator, Pass};
use crate::data::{AssetError, Assets, FrameInput, Target};
use crate::error::{RefineError, guard};
use crate::scene::Frame;
use crate::workers::Workers;

/// Parameters that change by fewer of their deviations are found.
const SETTLED: f64 = 0.05;

/// Passes that find poses as if nothing were known of them; the rig is much the same in later ones.
const ROUGH_PASSES: usize = 2;

/// Frames of a dataset, each with a rough pose (object → camera \[m\]); they are read when they are visited.
pub struct CalibrationFrames {
    /// Target of each, and its rough pose.
    pub poses: Vec<(Target, Isometry3<f64>)>,
    assets: Mutex<Assets>,
}

/// Results of a calibration.
pub struct Calibrated {
    /// The calibrator, which has the rig.
    pub calibrator: Calibrator,
    /// Object → camera \[m\], by the frames' indices.
    pub poses: BTreeMap<usize, Isometry3<f64>>,
    /// Messages about frames that are left out as they disagree with the rig, by their indices.
    pub left_out: BTreeMap<usize, String>,
    /// Errors of the frames that could not be visited, by their indices.
    pub failed: BTreeMap<usize, AssetError>,
    /// Frames that have no mask.
    pub without_mask: usize,
}

/// Hears how many of the visits that there are at most have been made, or will not have to be.
type VisitProgress<'a> = dyn FnMut(usize) + 'a;

impl CalibrationFrames {
    /// Frames of the objects and hands of `assets`. Masks may be missing where it has them [optional](Assets::with_optional_masks).
    pub fn new(assets: Assets, poses: Vec<(Target, Isometry3<f64>)>) -> Self {
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
            match assets.load(&target, None, &[]) {
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
        let Target { obj_id, .. } = self.poses[index].0;
        let mut assets = self.assets.lock().unwrap_or_else(PoisonError::into_inner);
        let frame = assets.load(&self.poses[index].0, None, &[])?.frame;
        Ok(CalibrationFrame { frame, obj_id, initial: *pose, is_refined: false })
    }

    /// Calibrates `calibrator` by at most `most` passes over each window of so many frames, or over all at once; `progress` hears of visits, of which there
    /// are at most as many as passes times frames.
    ///
    /// # Errors
    /// If a rig cannot be solved for, or the system gives no threads.
    pub fn calibrate(
        &self,
        calibrator: Calibrator,
        most: NonZeroUsize,
        window: Option<NonZeroUsize>,
        progress: &mut VisitProgress<'_>,
    ) -> Result<Calibrated, AssetError> {
        let (poses, left_out) = (BTreeMap::new(), BTreeMap::new());
        let failed = BTreeMap::new();
        let mut done = Calibrated { calibrator, poses, left_out, failed, without_mask: 0 };
        let count = self.poses.len();
        let size = window.map_or(count, NonZeroUsize::get).max(1);
        for start in (0..count).step_by(size) {
            self.learn(start..(start + size).min(count), most.get(), &mut done, progress)?;
        }
        Ok(done)
    }

    /// Learns from the frames of a window, by at most `most` passes, until the rig is settled, and keeps what they say. Frames are visited from where they are
    /// known to be, or else from where they were said to be; sums are the same for any number of threads.
    fn learn(
        &self,
        window: Range<usize>,
        most: usize,
        done: &mut Calibrated,
        progress: &mut VisitProgress<'_>,
    ) -> Result<(), AssetError> {
        let indices: Vec<usize> = window.collect();
        for number in 1..=most {
            let mut pass = Pass::default();
            let (mut poses, mut left_out) = (BTreeMap::new(), BTreeMap::new());
            let (mut failed, mut without_mask) = (BTreeMap::new(), 0);
            let visit = |index: usize| {
                guard(|| {
                    let known = done.poses.get(&index);
                    let mut frame = self.load(index, known.unwrap_or(&self.poses[index].1))?;
                    frame.is_refined = number > ROUGH_PASSES && known.is_some();
                    Ok::<_, AssetError>(done.calibrator.visit(&frame)?)
                })
            };
            let workers = Workers::new(indices.len(), rayon::current_num_threads())?;
            workers.run_in_order(&indices, visit, |index, outcome| {
                progress(1);
                let target = self.poses[index].0;
                match outcome {
                    Ok(visit) => {
                        left_out.extend(visit.left_out.map(|times| {
                            let what = format!(
                                "{target}: left out, disagrees {times:.1} times more than is usual: its pose \
                                 is wrong, or the rig was another"
                            );
                            (index, what)
                        }));
                        poses.insert(index, visit.t_cam_object);
                        without_mask += usize::from(!visit.has_mask);
                        pass.add(visit);
                    }
                    Err(error) => drop(failed.insert(index, error)),
                }
            });
            let nothing = poses.is_empty();
            done.poses.append(&mut poses);
            let change = if nothing { 0.0 } else { done.calibrator.solve(&mut pass)? };
            log::info!("pass {number}: parameters changed by up to {change:.2} deviations");
            if change < SETTLED || number == most {
                progress((most - number) * indices.len());
                done.calibrator.keep(pass);
                done.poses.retain(|index, _| !failed.contains_key(index));
                done.without_mask += without_mask;
                done.failed.append(&mut failed);
                done.left_out.append(&mut left_out);
                break;
            }
        }
        Ok(())
    }
}
