//! `prehend calibrate`.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Mutex, PoisonError};

use anyhow::Context;
use clap::Args;
use nalgebra::Isometry3;
use prehend_refine::data::bop::check_writable;
use prehend_refine::data::{Assets, FrameInput, Sensor, Workers};
use prehend_refine::rig::{CalibrationFrame, Calibrator, CalibratorSettings, Pass, Visit};

use crate::options::{Input, Job, limit_threads};
use crate::terminal::{cache, complain, exit_code, progress, say};

#[derive(Args)]
pub(crate) struct Calibrate {
    #[command(flatten)]
    input: Input,
    /// Write the rig here, as JSON (see docs/RIG.md); an existing one is replaced
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    out: PathBuf,
    /// Write the corrected models to this folder, as obj_ID.ply in millimeters
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    models: Option<PathBuf>,
    /// Passes over all frames
    #[arg(long, value_name = "N", default_value = "6")]
    passes: NonZeroUsize,
    /// Worker threads; the rig is the same for any number [default: all cores]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
}

impl Calibrate {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        check_writable(&self.out)?;
        limit_threads(self.threads)?;
        if let Some(folder) = &self.models {
            std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        }
        let dataset = self.input.selection.open()?;
        let (jobs, mut failures) = self.input.selection.jobs(&self.input.poses)?;
        let mut assets = Assets::new(&dataset, 0).with_cache(cache());
        let ids: BTreeSet<u32> = jobs.iter().map(|job| job.target.obj_id).collect();
        let objects: BTreeMap<_, _> =
            ids.iter().map(|id| Ok((*id, assets.object(*id)?))).collect::<anyhow::Result<_>>()?;
        let first = jobs.iter().find_map(|job| {
            let FrameInput { observation, hand, .. } =
                assets.load(&job.target, &[Sensor::Hand]).ok()?;
            let size = (observation.camera.width, observation.camera.height);
            Some((hand?.tree.joint_names().len(), size))
        });
        let (joints, size) = first.context(NO_HAND)?;
        let settings = CalibratorSettings::default();
        let mut calibrator = Calibrator::new(joints, size, objects.clone(), settings)?;
        let assets = Mutex::new(assets);
        let mut poses: Vec<_> = jobs.iter().map(|job| job.row.t_cam_model).collect();
        let passes = self.passes.get();
        let bar = progress(passes * jobs.len(), "calibrating");
        let indices: Vec<usize> = (0..jobs.len()).collect();
        let mut count = 0;
        let mut left_out = Vec::new();
        for number in 0..passes {
            let mut pass = Pass::default();
            let mut found = BTreeMap::new();
            count = 0;
            let mut next = 0;
            let mut missed = Vec::new();
            left_out.clear();
            let before = poses.clone();
            Workers::new(jobs.len(), rayon::current_num_threads())?.run(
                &indices,
                || |&index: &usize| visit(&calibrator, &assets, &jobs[index], &before[index]),
                |&index, outcome| -> anyhow::Result<()> {
                    bar.inc(1);
                    found.insert(index, outcome);
                    // In order, so that sums are the same for any number of threads.
                    while let Some(outcome) = found.remove(&next) {
                        match outcome {
                            Ok(visit) => {
                                poses[next] = visit.t_cam_object;
                                let target = jobs[next].target;
                                left_out.extend(visit.left_out.map(|times| {
                                    format!(
                                        "{target}: left out, disagrees {times:.1} times more than is \
                                         usual: its pose is wrong, or the rig was another"
                                    )
                                }));
                                pass.add(visit);
                                count += 1;
                            }
                            Err(error) => missed.push(format!("{}: {error}", jobs[next].target)),
                        }
                        next += 1;
                    }
                    Ok(())
                },
            )?;
            if count == 0 || number + 1 == passes {
                failures.append(&mut missed);
            }
            if count == 0 {
                break;
            }
            let change = calibrator.solve(pass)?;
            log::info!("pass {}: parameters changed by up to {change:.2} deviations", number + 1);
        }
        bar.finish_and_clear();
        left_out.iter().for_each(|frame| complain(format!("warning: {frame}")));
        if count > 0 {
            let rig = calibrator.rig();
            rig.save(&self.out)?;
            if let Some(folder) = &self.models {
                for (id, deviation) in &rig.objects {
                    let mesh = deviation.applied(&objects[id].mesh).scaled(1e3);
                    mesh.save_ply(&folder.join(format!("obj_{id:06}.ply")))?;
                }
            }
            say(summary(&calibrator))?;
            let frames = count - left_out.len();
            say(format!("rig of {frames} frames written to {}", self.out.display()))?;
        }
        Ok(exit_code(count, &failures))
    }
}

const NO_HAND: &str = "nothing is known of a hand, which is part of the rig";

/// What a frame says of the rig.
fn visit(
    calibrator: &Calibrator,
    assets: &Mutex<Assets<'_>>,
    job: &Job,
    pose: &Isometry3<f64>,
) -> anyhow::Result<Visit> {
    let input = {
        let mut assets = assets.lock().unwrap_or_else(PoisonError::into_inner);
        assets.load(&job.target, &[Sensor::Hand])?
    };
    let FrameInput { observation, hand, .. } = input;
    let (obj_id, hand) = (job.target.obj_id, hand.context(NO_HAND)?);
    let frame = CalibrationFrame { observation, obj_id, hand, initial: *pose };
    Ok(calibrator.visit(&frame)?)
}

/// A table of the parameters, but for the coefficients of depth's field.
fn summary(calibrator: &Calibrator) -> String {
    let rig = calibrator.rig();
    let (values, sigmas) = (rig.parameters(), rig.covariance.diagonal().map(f64::sqrt));
    let mut text = format!("{:28} {:>10} {:>10} {:>10}", "parameter", "value", "sigma", "before");
    for ((name, value), (sigma, before)) in
        values.iter().zip(sigmas.iter().zip(calibrator.prior_sigmas()))
    {
        text += &format!("\n{name:28} {value:10.5} {sigma:10.5} {before:10.5}");
    }
    text
}
