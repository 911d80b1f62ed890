//! Passes over frames.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::ops::Range;

use nalgebra::Isometry3;

use super::frames::CalibrationFrames;
use crate::calibration::{Calibrator, Pass, Visit};
use crate::data::AssetError;
use crate::error::guard;
use crate::workers::Workers;

/// Parameters that change by fewer of their deviations are found.
const SETTLED: f64 = 0.05;

/// Passes that find poses as if nothing were known of them; the rig is much the same in later ones.
const ROUGH_PASSES: usize = 2;

/// Passes over all frames of a dataset, window by window, until the rig is settled.
pub struct Passes<'a> {
    frames: &'a CalibrationFrames<'a>,
    most: usize,
    window: usize,
}

/// What they have found.
pub struct Calibrated {
    /// The calibrator, which has the rig.
    pub calibrator: Calibrator,
    /// Object → camera \[m\], by the frames' indices.
    pub poses: BTreeMap<usize, Isometry3<f64>>,
    /// What is to be said of frames that disagree with the rig, by their indices.
    pub left_out: BTreeMap<usize, String>,
    /// What is wrong with the frames that could not be visited, by their indices.
    pub failed: BTreeMap<usize, AssetError>,
    /// Frames that have no mask.
    pub without_mask: usize,
}

/// Hears how many of the visits that there are at most have been made, or will not have to be.
type VisitProgress<'a> = dyn FnMut(usize) + 'a;

impl<'a> Passes<'a> {
    /// At most so many passes over each window of so many frames, or over all at once.
    pub fn new(
        frames: &'a CalibrationFrames<'a>,
        most: NonZeroUsize,
        window: Option<NonZeroUsize>,
    ) -> Self {
        let window = window.map_or(frames.poses.len(), NonZeroUsize::get);
        Self { frames, most: most.get(), window }
    }

    /// Learns from all frames; `progress` hears of visits, of which there are at most as many as passes times frames.
    ///
    /// # Errors
    /// If a rig cannot be solved for, or the system gives no threads.
    pub fn run(
        &self,
        calibrator: Calibrator,
        progress: &mut VisitProgress<'_>,
    ) -> Result<Calibrated, AssetError> {
        let (poses, left_out) = (BTreeMap::new(), BTreeMap::new());
        let failed = BTreeMap::new();
        let mut done = Calibrated { calibrator, poses, left_out, failed, without_mask: 0 };
        let count = self.frames.poses.len();
        for start in (0..count).step_by(self.window.max(1)) {
            self.learn(start..(start + self.window).min(count), &mut done, progress)?;
        }
        Ok(done)
    }

    /// Learns from the frames of a window until the rig is settled, and keeps what they say.
    fn learn(
        &self,
        window: Range<usize>,
        done: &mut Calibrated,
        progress: &mut VisitProgress<'_>,
    ) -> Result<(), AssetError> {
        for number in 1..=self.most {
            let mut pass = Pass::default();
            let (mut poses, mut left_out) = (BTreeMap::new(), BTreeMap::new());
            let (mut failed, mut without_mask) = (BTreeMap::new(), 0);
            let is_refined = number > ROUGH_PASSES;
            self.visit_all(window.clone(), done, is_refined, |index, outcome| {
                progress(1);
                let target = self.frames.poses[index].0;
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
            })?;
            let nothing = poses.is_empty();
            done.poses.append(&mut poses);
            let change = if nothing { 0.0 } else { done.calibrator.solve(&mut pass)? };
            log::info!("pass {number}: parameters changed by up to {change:.2} deviations");
            if change < SETTLED || number == self.most {
                let passes = self.most - number;
                progress(passes * window.len());
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

    /// Visits the frames of a window from where they are `known` to be, or else from where they were said to be; `each` hears of them in their
    /// order, so that sums are the same for any number of threads.
    fn visit_all(
        &self,
        window: Range<usize>,
        known: &Calibrated,
        is_refined: bool,
        each: impl FnMut(usize, Result<Visit, AssetError>),
    ) -> Result<(), AssetError> {
        let indices: Vec<usize> = window.collect();
        let starts: Vec<_> = indices.iter().map(|index| known.poses.get(index).copied()).collect();
        let first = indices.first().copied().unwrap_or(0);
        let visit = |index: usize| {
            let told = self.frames.poses[index].1;
            guard(|| {
                let mut frame = self.frames.load(index, &starts[index - first].unwrap_or(told))?;
                frame.is_refined = is_refined && starts[index - first].is_some();
                Ok(known.calibrator.visit(&frame)?)
            })
        };
        Workers::new(indices.len(), rayon::current_num_threads())?
            .run_in_order(&indices, visit, each);
        Ok(())
    }
}
