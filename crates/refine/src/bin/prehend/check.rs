//! `prehend check`.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use prehend_refine::TermKind;
use prehend_refine::data::bop::{DatasetError, Frame, ResultRow};
use prehend_refine::data::{AssetError, Assets};
use prehend_refine::evaluate::report::{Report, outline_picture};
use prehend_refine::scene::{Hand, Observation, inspect_object, inspect_pose};

use crate::cache;
use crate::options::{Input, Job, label};
use crate::outcome::Outcome;
use crate::output::{complain, say};
use crate::progress;

#[derive(Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: Input,
    /// Write the pictures and a web page of them here
    #[arg(long, value_name = "DIR", default_value = "out/check", help_heading = "Output")]
    report: PathBuf,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let dataset = arguments.input.open()?;
    let (jobs, mut failures) = arguments.input.jobs()?;
    let mut assets = Assets::new(&dataset, 0).with_cache(cache::open());
    let mut report = Report::create(&arguments.report)?;
    let mut done = 0;
    let bar = progress::bar(jobs.len() as u64, "drawing");
    for job in &jobs {
        match check(&mut assets, job) {
            Ok((picture, warnings)) => {
                for warning in &warnings {
                    bar.suspend(|| complain(format!("warning: {}: {warning}", label(&job.row))));
                }
                report.add_picture(&label(&job.row), &picture, &warnings)?;
                done += 1;
            }
            Err(error) => failures.push(format!("{}: {error}", label(&job.row))),
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    if done > 0 {
        say(format!("{done} pictures; open {}", report.finish()?.display()))?;
    }
    Ok(Outcome { done, failures })
}

fn check(
    assets: &mut Assets<'_>,
    job: &Job,
) -> Result<(prehend_render::RgbImage, Vec<String>), AssetError> {
    let ResultRow { scene_id, im_id, obj_id, t_cam_model, .. } = &job.row;
    let object = assets.object(*obj_id)?;
    let frame = assets.dataset().frame(*scene_id, *im_id)?;
    let (observation, robot, mut warnings) = sensed(assets, &frame, job.instance)?;
    warnings.extend(inspect_object(&object));
    warnings.extend(inspect_pose(&observation, &object, robot.as_deref(), t_cam_model));
    Ok((outline_picture(&observation, &object, robot.as_deref(), t_cam_model), warnings))
}

/// What a frame brings, and what it lacks.
type Sensed = (Observation, Option<Arc<Hand>>, Vec<String>);

/// The frame with all that it brings; a warning where it has no hand or no touch, as plain BOP datasets.
fn sensed(
    assets: &mut Assets<'_>,
    frame: &Frame<'_>,
    instance: usize,
) -> Result<Sensed, AssetError> {
    use TermKind::{Depth, Physics, Rendering};
    let all = assets.observation(frame, instance, &TermKind::ALL);
    let Some(absent) = absent_extension(&all) else {
        return all.map(|(observation, robot)| (observation, robot, Vec::new()));
    };
    let without_touch = assets.observation(frame, instance, &[Physics, Rendering, Depth]);
    let (rest, terms) = match absent_extension(&without_touch) {
        None => (without_touch, "physics,rendering,depth"),
        Some(_) => (assets.observation(frame, instance, &[Rendering, Depth]), "rendering,depth"),
    };
    let (observation, robot) = rest?;
    let warning = format!("there is no {absent}: --method combined needs --terms {terms}");
    Ok((observation, robot, vec![warning]))
}

/// The file beyond BOP's own whose absence is the fault.
fn absent_extension<T>(result: &Result<T, AssetError>) -> Option<String> {
    let Err(AssetError::Dataset(DatasetError::Missing { file })) = result else { return None };
    let extension = ["scene_bodies.json", "scene_tactile.json"].iter().any(|n| file.ends_with(n));
    extension.then(|| file.display().to_string())
}
