//! `prehend check`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use nalgebra::Isometry3;
use prehend_refine::data::{AssetError, Assets, FrameInput, load_frame_file};
use prehend_refine::evaluate::report::{Report, outline_picture};
use prehend_refine::scene::Warning;
use prehend_render::RgbImage;

use crate::options::{Job, Selection};
use crate::terminal::{cache, exit_code, progress, say, warn};

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
    /// Instead of a dataset, one frame described by a JSON file (see docs/FRAME.md)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["Selection", "poses"])]
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
        let (picture, warnings) = drawn(&input, &t_cam_object);
        warnings.iter().for_each(|warning| log::warn!("{warning}"));
        report.add_picture(&file.display().to_string(), &picture, &warnings)?;
        say(format!("1 picture; open {}", report.finish()?.display()))?;
        Ok(ExitCode::SUCCESS)
    }

    /// Checks the poses of the file `poses`.
    fn dataset(&self, selection: &Selection, poses: &Path) -> anyhow::Result<ExitCode> {
        let dataset = selection.open()?;
        let (jobs, mut failures) = selection.jobs(poses)?;
        let mut assets = Assets::new(&dataset, 0).with_cache(cache());
        let mut report = Report::create(&self.report, "Input")?;
        let mut done = 0;
        let bar = progress(jobs.len(), "drawing");
        for job in bar.wrap_iter(jobs.iter()) {
            match check(&mut assets, job) {
                Ok((picture, warnings)) => {
                    for warning in &warnings {
                        warn(&bar, job.target, warning);
                    }
                    report.add_picture(&job.target.to_string(), &picture, &warnings)?;
                    done += 1;
                }
                Err(error) => failures.push(format!("{}: {error}", job.target)),
            }
        }
        if done > 0 {
            say(format!("{done} pictures; open {}", report.finish()?.display()))?;
        }
        Ok(exit_code(done, &failures))
    }
}

fn check(assets: &mut Assets<'_>, job: &Job) -> Result<(RgbImage, Vec<String>), AssetError> {
    let input = assets.load(&job.target, &[])?;
    let FrameInput { observation, hand, .. } = &input;
    let touches = observation.hand.as_ref().is_some_and(|hand| !hand.forces.is_empty());
    // Plain BOP datasets have neither file.
    let absent = match hand {
        None => Some(("scene_bodies.json", "rendering,depth")),
        Some(_) if !touches => Some(("scene_tactile.json", "physics,rendering,depth")),
        Some(_) => None,
    };
    let (picture, mut warnings) = drawn(&input, &job.row.t_cam_model);
    if let Some((name, terms)) = absent {
        let file = assets.dataset().scene(job.target.scene_id)?.dir().join(name);
        let file = file.display();
        let absent = format!("there is no {file}: --method combined needs --terms {terms}");
        warnings.insert(0, absent);
    }
    Ok((picture, warnings))
}

/// The object at a pose, and the hand, over their image; and what looks wrong.
fn drawn(input: &FrameInput, t_cam_object: &Isometry3<f64>) -> (RgbImage, Vec<String>) {
    let FrameInput { observation, object, hand, .. } = input;
    let warnings = input.warnings(t_cam_object).concat();
    let picture = outline_picture(observation, object, hand.as_deref(), t_cam_object);
    (picture, warnings.iter().map(Warning::to_string).collect())
}
