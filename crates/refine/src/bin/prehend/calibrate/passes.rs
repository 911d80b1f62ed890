//! Passes over frames.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::ops::Range;

use indicatif::ProgressBar;
use nalgebra::Isometry3;
use prehend_refine::data::Workers;
use prehend_refine::rig::{Calibrator, Pass, Visit};

use super::Frames;
use crate::terminal::progress;

/// Parameters that change by fewer of their deviations are found.
const SETTLED: f64 = 0.05;

/// Passes that find poses as if nothing were known of them; the rig is much the same in later ones.
const ROUGH_PASSES: usize = 2;

/// All frames, window by window, each in several passes.
pub(super) struct Passes<'a> {
    frames: &'a Frames<'a>,
    most: usize,
    window: usize,
    bar: ProgressBar,
}

/// What they have found.
pub(super) struct Done {
    pub(super) calibrator: Calibrator,
    /// Object → camera \[m\], by the frames' indices.
    pub(super) poses: BTreeMap<usize, Isometry3<f64>>,
    /// What is to be said of frames that disagree with the rig, by their indices.
    pub(super) left_out: BTreeMap<usize, String>,
    pub(super) failed: BTreeMap<usize, anyhow::Error>,
    /// Frames that have no mask.
    pub(super) without_mask: usize,
}

impl<'a> Passes<'a> {
    pub(super) fn new(
        frames: &'a Frames<'a>,
        most: NonZeroUsize,
        window: Option<NonZeroUsize>,
    ) -> Self {
        let (count, most) = (frames.jobs.len(), most.get());
        let window = window.map_or(count, NonZeroUsize::get);
        Self { frames, most, window, bar: progress(most * count, "calibrating") }
    }

    pub(super) fn run(&self, calibrator: Calibrator) -> anyhow::Result<Done> {
        let (poses, left_out) = (BTreeMap::new(), BTreeMap::new());
        let failed = BTreeMap::new();
        let mut done = Done { calibrator, poses, left_out, failed, without_mask: 0 };
        let count = self.frames.jobs.len();
        for start in (0..count).step_by(self.window.max(1)) {
            self.learn(start..(start + self.window).min(count), &mut done)?;
        }
        self.bar.finish_and_clear();
        Ok(done)
    }

    /// Learns from the frames of a window until the rig is settled, and keeps what they say.
    fn learn(&self, window: Range<usize>, done: &mut Done) -> anyhow::Result<()> {
        for number in 1..=self.most {
            let mut pass = Pass::default();
            let (mut poses, mut left_out) = (BTreeMap::new(), BTreeMap::new());
            let (mut failed, mut without_mask) = (BTreeMap::new(), 0);
            let is_refined = number > ROUGH_PASSES;
            self.visit_all(window.clone(), done, is_refined, |index, outcome| {
                let target = self.frames.jobs[index].target;
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
                let passes = (self.most - number) as u64;
                self.bar.inc(passes * window.len() as u64);
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
        known: &Done,
        is_refined: bool,
        mut each: impl FnMut(usize, anyhow::Result<Visit>),
    ) -> anyhow::Result<()> {
        let indices: Vec<usize> = window.collect();
        let starts: Vec<_> = indices.iter().map(|index| known.poses.get(index).copied()).collect();
        let first = indices.first().copied().unwrap_or(0);
        let visit = |index: usize| {
            let told = self.frames.jobs[index].row.t_cam_model;
            let mut frame = self.frames.load(index, &starts[index - first].unwrap_or(told))?;
            frame.is_refined = is_refined && starts[index - first].is_some();
            Ok(known.calibrator.visit(&frame)?)
        };
        in_order(&indices, visit, |index, outcome| {
            self.bar.inc(1);
            each(index, outcome);
        })
    }
}

/// Does the `work` of all indices in parallel; `each` hears of them in their order, so that sums are the same for any number of threads.
pub(super) fn in_order<T: Send>(
    indices: &[usize],
    work: impl Fn(usize) -> T + Sync,
    mut each: impl FnMut(usize, T),
) -> anyhow::Result<()> {
    let mut waiting = BTreeMap::new();
    let mut next = indices.iter();
    let mut expected = next.next();
    Workers::new(indices.len(), rayon::current_num_threads())?.run(
        indices,
        || |&index: &usize| work(index),
        |&index, outcome| -> anyhow::Result<()> {
            waiting.insert(index, outcome);
            while let Some((index, outcome)) =
                expected.and_then(|index| waiting.remove_entry(index))
            {
                each(index, outcome);
                expected = next.next();
            }
            Ok(())
        },
    )
}
