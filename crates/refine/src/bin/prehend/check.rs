//! `prehend check`.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use nalgebra::Isometry3;
use prehend_refine::EstimatorInput;
use prehend_refine::check::{
    CorrectionSettings, CorrectionTrial, FieldNames, Finding, Warning, find_corrections,
};
use prehend_refine::data::bop::{Dataset, DatasetError};
use prehend_refine::data::{Assets, FrameInput, MaskSource, Target, load_frame_file};
use prehend_refine::evaluate::report::{Report, outline_picture};
use prehend_render::RgbImage;

use crate::options::{Job, Masks, Selection, advice};
use crate::terminal::{cache, progress, say, warn};

#[derive(Args)]
#[command(next_help_heading = "Input")]
#[command(override_usage = "prehend check --dataset <DIR> --poses <FILE> [OPTIONS]\n       \
                            prehend check --frame <FILE> [OPTIONS]")]
#[command(mut_arg("dataset", |a| a.required(false).required_unless_present("frame")))]
pub(crate) struct Check {
    #[command(flatten)]
    selection: Option<Selection>,
    /// Poses on the dataset's images, as a BOP results file
    #[arg(long, value_name = "FILE", required_unless_present = "frame")]
    poses: Option<PathBuf>,
    #[command(flatten)]
    masks: Masks,
    /// Instead of a dataset, one frame described by a JSON file (see docs/FRAME.md)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["Selection", "Masks", "poses"])]
    frame: Option<PathBuf>,
    /// Write the pictures and a web page of them here
    #[arg(long, value_name = "DIR", default_value = "out/check", help_heading = "Output")]
    report: PathBuf,
}

impl Check {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match (&self.frame, &self.selection, &self.poses) {
            (Some(file), ..) => self.frame(file),
            (None, Some(selection), Some(poses)) => self.dataset(selection, poses),
            _ => bail!("give --dataset and --poses, or --frame"),
        }
    }

    /// Checks the frame of `file`.
    fn frame(&self, file: &Path) -> anyhow::Result<ExitCode> {
        let (input, t_cam_object) = load_frame_file(file, 0, cache().as_ref(), None)?;
        let mut report = Report::create(&self.report, "Input")?;
        let settings = CorrectionSettings::default();
        // No scene, no image, no object: one frame of a file of its own.
        let target = Target { scene_id: 0, im_id: 0, obj_id: 0, instance: 0 };
        let trial = CorrectionTrial::new(&input.frame, &input.object, &t_cam_object, &settings)?;
        let findings = find_corrections(&[(target, trial)], &settings);
        let names = names_of_frame(file);
        let mut warnings: Vec<String> =
            findings.iter().map(|found| found.message(&names)).collect();
        let (picture, others) = drawn(&input, &t_cam_object);
        let told = |warning: &Warning| findings.iter().any(|found| found.explains(warning));
        warnings.extend(others.concat().iter().filter(|w| !told(w)).map(Warning::to_string));
        warnings.iter().for_each(|warning| log::warn!("{warning}"));
        report.add_picture(&file.display().to_string(), &picture, &warnings)?;
        say(format!("1 picture; open {}", report.finish()?.display()))?;
        Ok(ExitCode::SUCCESS)
    }

    /// Checks the poses of a dataset.
    fn dataset(&self, selection: &Selection, poses: &Path) -> anyhow::Result<ExitCode> {
        let dataset = selection.open()?;
        let (jobs, mut failures) = selection.jobs(poses, None)?;
        let masks = match self.masks.source()? {
            // A pose is not checked by what is made of it.
            MaskSource::Silhouettes => MaskSource::None,
            masks => masks,
        };
        let mut assets = Assets::new(&dataset, 0).with_cache(cache()).with_masks(masks);
        let findings = mistakes(&mut assets, &jobs);
        let named = |(targets, found): (Vec<Target>, Finding)| {
            let message = found.message(&names_of_dataset(&dataset, poses, &targets)?);
            match &targets[..] {
                [target] if jobs.len() > 1 => log::warn!("{target}: {message}"),
                _ => log::warn!("{message}"),
            }
            Ok((found, targets, message))
        };
        let findings = findings.into_iter().map(named).collect::<Result<Vec<_>, DatasetError>>()?;
        let mut report = Report::create(&self.report, "Input")?;
        let (mut done, mut introduced) = (0, BTreeSet::new());
        let bar = progress(jobs.len(), "drawing");
        for job in bar.wrap_iter(jobs.iter()) {
            let Job { target, row, .. } = job;
            let input = assets.load(target, Some(&row.t_cam_model), &[]);
            let input = input.map_err(|error| format!("{error}{}", advice(&error)));
            let Some(input) = failures.keep(target, input) else { continue };
            without(&dataset, &input, target);
            let (picture, warnings) = drawn(&input, &row.t_cam_model);
            // Of many frames some alone were tried.
            let is_meant = |targets: &[Target]| match targets {
                [only] => only == target,
                all => {
                    all.iter().any(|t| (t.scene_id, t.obj_id) == (target.scene_id, target.obj_id))
                }
            };
            let own = findings.iter().filter(|(_, targets, _)| is_meant(targets));
            let (found, mut remarks): (Vec<_>, Vec<_>) =
                own.map(|(found, _, message)| (found, message.clone())).unzip();
            let untold = |warnings: &[Warning]| -> Vec<String> {
                let told = |w: &&Warning| found.iter().any(|found| found.explains(w));
                warnings.iter().filter(|w| !told(w)).map(Warning::to_string).collect()
            };
            let [of_object, of_frame] = warnings.map(|warnings| untold(&warnings));
            for text in &of_object {
                if introduced.insert((target.obj_id, text.clone())) {
                    warn(&bar, format!("object {}", target.obj_id), text);
                }
            }
            of_frame.iter().for_each(|text| warn(&bar, target, text));
            remarks.extend(of_object.into_iter().chain(of_frame));
            report.add_picture(&target.to_string(), &picture, &remarks)?;
            done += 1;
        }
        if done > 0 {
            say(format!("{done} pictures; open {}", report.finish()?.display()))?;
        }
        Ok(failures.exit_code(done))
    }
}

/// Mistakes that many of the frames have in common, each with the targets that it was found in. Frames that cannot be read are left out.
fn mistakes(assets: &mut Assets, jobs: &[Job]) -> Vec<(Vec<Target>, Finding)> {
    let settings = CorrectionSettings::default();
    let stride = jobs.len().div_ceil(settings.frames).max(1);
    let bar = progress(jobs.len() / stride, "comparing");
    let attempt = |Job { target, row, .. }: &Job| {
        let input = assets.load(target, Some(&row.t_cam_model), &[]).ok()?;
        let FrameInput { frame, object, .. } = &input;
        let trial = CorrectionTrial::new(frame, object, &row.t_cam_model, &settings);
        Some((*target, trial.ok()?))
    };
    let trials: Vec<(Target, CorrectionTrial)> =
        bar.wrap_iter(jobs.iter().step_by(stride)).filter_map(attempt).collect();
    let targets = |found: &Finding| found.frames.iter().map(|&k| trials[k].0).collect();
    let found = find_corrections(&trials, &settings).into_iter();
    found.map(|found| (targets(&found), found)).collect()
}

/// Says what a plain BOP dataset does not have, and which methods need it.
fn without(dataset: &Dataset, input: &FrameInput, target: &Target) {
    let touches = input.frame.hand.as_ref().is_some_and(|hand| !hand.forces.is_empty());
    let (name, terms) = match &input.frame.hand {
        None => ("scene_bodies.json", "rendering,depth"),
        Some(_) if !touches => ("scene_tactile.json", "physics,rendering,depth"),
        Some(_) => return,
    };
    if let Ok(scene) = dataset.scene(target.scene_id) {
        let file = scene.dir().join(name);
        log::info!(
            "{target}: there is no {}: --method combined needs --terms {terms}",
            file.display()
        );
    }
}

/// Files and fields of the poses on `targets`.
fn names_of_dataset(
    dataset: &Dataset,
    poses: &Path,
    targets: &[Target],
) -> Result<FieldNames, DatasetError> {
    let only = |id: fn(&Target) -> u32| {
        let ids: BTreeSet<u32> = targets.iter().map(id).collect();
        ids.first().copied().filter(|_| ids.len() == 1)
    };
    let scene = match only(|target| target.scene_id) {
        Some(id) => dataset.scene(id)?.dir().to_owned(),
        None => dataset.split_dir().join("*"),
    };
    let models = dataset.models();
    let mesh = match only(|target| target.obj_id) {
        Some(id) => models.mesh_path(id)?,
        None => models.dir().join("*.ply"),
    };
    Ok(FieldNames {
        poses: poses.display().to_string(),
        rotation: "R",
        translation: "t",
        mesh: mesh.display().to_string(),
        camera: scene.join("scene_camera.json").display().to_string(),
        intrinsics: "cam_K",
        depth_scale: "depth_scale",
        masks: scene.join("mask_visib").display().to_string(),
        colors: scene.join("rgb").display().to_string(),
    })
}

/// Fields of a frame file.
fn names_of_frame(file: &Path) -> FieldNames {
    let file = file.display();
    FieldNames {
        poses: file.to_string(),
        rotation: "pose",
        translation: "pose.translation",
        mesh: format!("{file}: mesh, mesh_unit"),
        camera: file.to_string(),
        intrinsics: "K",
        depth_scale: "depth_unit_m",
        masks: format!("{file}: mask"),
        colors: format!("{file}: rgb"),
    }
}

/// The object at a pose, and the hand, over their image; and what looks wrong with the object, and with the frame.
fn drawn(input: &FrameInput, t_cam_object: &Isometry3<f64>) -> (RgbImage, [Vec<Warning>; 2]) {
    let FrameInput { frame, object, .. } = input;
    let warnings = EstimatorInput::new(frame, object).warnings(t_cam_object);
    (outline_picture(frame, object, t_cam_object), warnings)
}
