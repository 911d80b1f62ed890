//! `prehend calibrate`.

mod report;

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use anyhow::bail;
use clap::Args;
use nalgebra::Isometry3;
use prehend_refine::calibration::Calibrator;
use prehend_refine::data::Assets;
use prehend_refine::data::CalibrationFrames;
use prehend_refine::data::bop::{ResultRow, check_writable, create_folder};
use prehend_refine::data::identity::canonical;
use prehend_refine::evaluate::report::Report;
use prehend_refine::scene::Object;

use crate::options::{InputArgs, Job, limit_threads, write_poses};
use crate::settings::SettingsOptions;
use crate::terminal::{cache, progress, say};

#[derive(Args)]
pub(crate) struct Calibrate {
    #[command(flatten)]
    input: InputArgs,
    /// Write the rig here, as JSON (see docs/RIG.md); an existing one is replaced
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    out: PathBuf,
    /// Write the corrected models to this folder, as obj_ID.ply in millimeters [default: rig.models beside rig.json]
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    models: Option<PathBuf>,
    /// Write the frames' poses here, as a BOP results file with the scores of the initial poses; with --window, as they were with the rig until then
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    refined: Option<PathBuf>,
    /// Write a web page here: residuals before and after, by sensor, with pictures
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    report: Option<PathBuf>,
    /// Passes over all frames, at most
    #[arg(long, value_name = "N", default_value = "6")]
    passes: NonZeroUsize,
    /// Take so many frames at a time, in the order of the poses, and keep what they say: then memory does not grow with their
    /// number [default: all]
    #[arg(long, value_name = "N")]
    window: Option<NonZeroUsize>,
    /// Worker threads; the rig is the same for any number [default: all cores]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    #[command(flatten)]
    settings: SettingsOptions,
}

impl Calibrate {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let models = self.models.clone().unwrap_or_else(|| self.out.with_extension("models"));
        check_writable(&self.out)?;
        if models == self.out || models.is_file() {
            bail!("--models {}: is no folder", models.display());
        }
        self.refined.as_deref().map(check_writable).transpose()?;
        limit_threads(self.threads)?;
        let create = |folder| Report::create(folder, "Rig");
        let report = self.report.as_deref().map(create).transpose()?;
        let dataset = self.input.selection.open()?;
        if canonical(&models) == canonical(dataset.models().dir()) {
            bail!("--models {}: has the models that are to be corrected", models.display());
        }
        let (jobs, mut failures) = self.input.selection.jobs(&self.input.poses, None)?;
        let mut assets = Assets::new(&dataset, 0).with_cache(cache()).with_optional_masks();
        let ids: BTreeSet<u32> = jobs.iter().map(|job| job.target.obj_id).collect();
        let objects: BTreeMap<_, _> =
            ids.iter().map(|id| Ok((*id, assets.object(*id)?))).collect::<anyhow::Result<_>>()?;
        let told = jobs.iter().map(|job| (job.target, job.row.t_cam_model)).collect();
        let frames = CalibrationFrames::new(assets, told);
        let (joints, size) = frames.layout()?;
        if joints.is_none() {
            log::warn!("no frame has a hand: camera and models are calibrated alone");
        }
        let settings = self.settings.load()?.calibration();
        let nominal = Calibrator::new(joints.unwrap_or(0), size, objects.clone(), settings)?;
        let bar = progress(self.passes.get() * jobs.len(), "calibrating");
        let progress = &mut |visits: usize| bar.inc(visits as u64);
        let done = frames.calibrate(nominal.clone(), self.passes, self.window, progress)?;
        bar.finish_and_clear();
        for (&index, error) in &done.failed {
            failures.add(format!("{}: {error}", frames.poses[index].0));
        }
        let count = done.poses.len();
        if count == 0 {
            return Ok(failures.exit_code(count));
        }
        done.left_out.values().for_each(|frame| log::warn!("{frame}"));
        if done.without_mask > 0 {
            let count = done.without_mask;
            log::warn!("{count} frames have no mask: their poses are taken to be good");
        }
        let calibrator = &done.calibrator;
        calibrator.rig().save(&self.out)?;
        if let Some(out) = &self.refined {
            write_poses(out, rows(&jobs, &done.poses), &mut failures)?;
        }
        say(parameters(calibrator))?;
        save_models(calibrator, &objects, &models)?;
        let (used, out) = (count - done.left_out.len(), self.out.display());
        say(format!("\nrig of {used} frames written to {out}, models to {}", models.display()))?;
        if let Some(report) = report {
            let page = report::write(report, &frames, (&nominal, size), &done, &mut failures)?;
            say(format!("report: open {}", page.display()))?;
        }
        Ok(failures.exit_code(count))
    }
}

/// Rows of a results file with these poses, by the frames' indices.
fn rows(jobs: &[Job], poses: &BTreeMap<usize, Isometry3<f64>>) -> Vec<ResultRow> {
    let row = |(&index, pose): (&usize, &Isometry3<f64>)| ResultRow {
        t_cam_model: *pose,
        time: -1.0,
        ..jobs[index].row.clone()
    };
    poses.iter().map(row).collect()
}

/// Writes `objects` as the rig corrects them.
fn save_models(
    calibrator: &Calibrator,
    objects: &BTreeMap<u32, Arc<Object>>,
    folder: &Path,
) -> anyhow::Result<()> {
    create_folder(folder)?;
    for (id, deviation) in &calibrator.rig().objects {
        let mesh = deviation.applied(&objects[id].mesh).scaled(1e3);
        mesh.save_ply(&folder.join(format!("obj_{id:06}.ply")))?;
    }
    Ok(())
}

/// A table of the parameters, but for the coefficients of depth's field.
fn parameters(calibrator: &Calibrator) -> String {
    let mut text = format!("{:28} {:>10} {:>10} {:>10}", "parameter", "value", "sigma", "before");
    for [name, value, sigma, before] in report::parameter_rows(calibrator) {
        text += &format!("\n{name:28} {value:>10} {sigma:>10} {before:>10}");
    }
    text
}
