//! `prehend check`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use prehend_refine::data::{AssetError, Assets, FrameInput};
use prehend_refine::evaluate::report::{Report, outline_picture};
use prehend_render::RgbImage;

use crate::options::{Input, Job};
use crate::terminal::{cache, exit_code, progress, say, warn};

#[derive(Args)]
pub(crate) struct Check {
    #[command(flatten)]
    input: Input,
    /// Write the pictures and a web page of them here
    #[arg(long, value_name = "DIR", default_value = "out/check", help_heading = "Output")]
    report: PathBuf,
}

impl Check {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let Input { selection, poses } = &self.input;
        let dataset = selection.open()?;
        let (jobs, mut failures) = selection.jobs(poses)?;
        let mut assets = Assets::new(&dataset, 0).with_cache(cache());
        let mut report = Report::create(&self.report)?;
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
    let FrameInput { observation, object, hand, .. } = &input;
    let t_cam_model = &job.row.t_cam_model;
    let mut warnings = Vec::new();
    let touches = observation.hand.as_ref().is_some_and(|hand| !hand.forces.is_empty());
    // Plain BOP datasets have neither file.
    let absent = match hand {
        None => Some(("scene_bodies.json", "rendering,depth")),
        Some(_) if !touches => Some(("scene_tactile.json", "physics,rendering,depth")),
        Some(_) => None,
    };
    if let Some((name, terms)) = absent {
        let file = assets.dataset().scene(job.target.scene_id)?.dir().join(name);
        let file = file.display();
        warnings.push(format!("there is no {file}: --method combined needs --terms {terms}"));
    }
    warnings.extend(input.warnings(t_cam_model).concat());
    Ok((outline_picture(observation, object, hand.as_deref(), t_cam_model), warnings))
}
