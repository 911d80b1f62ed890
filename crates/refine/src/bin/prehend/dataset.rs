//! `prehend refine --dataset`: many frames, side by side, resumable.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use prehend_refine::Config;
use prehend_refine::data::bop::{Dataset, ResultRow, share_image_times, write_results};
use prehend_refine::data::identity::{SENSED, canonical, dataset_fingerprint, file_fingerprint};
use prehend_refine::data::{AssetError, Assets, Identity, Journal, PlainPose, Times, Workers};
use prehend_refine::evaluate::report::{FrameReport, Report};
use prehend_refine::scene::{inspect_object, inspect_pose};
use prehend_refine::strategy::PosteriorSummary;
use prehend_refine::strategy::Trace;
use prehend_refine::{RefinedPose, refine_with};
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::cache;
use crate::options::{Job, Selection, beside, label};
use crate::outcome::Outcome;
use crate::output::{complain, say};
use crate::progress;

/// What to do with a dataset's frames.
pub(crate) struct Run<'a> {
    pub(crate) selection: &'a Selection,
    pub(crate) poses: &'a Path,
    /// Name of the method in the file of times.
    pub(crate) method: &'a str,
    pub(crate) config: &'a Config,
    pub(crate) seed: u64,
    pub(crate) threads: Option<NonZeroUsize>,
    pub(crate) out: &'a Path,
    pub(crate) report: Option<&'a Path>,
    pub(crate) json: bool,
    /// Put times into the results, and refine one frame at a time.
    pub(crate) time: bool,
    pub(crate) restart: bool,
}

/// A refined frame as the journal has it.
#[derive(Serialize, Deserialize)]
struct Refined {
    pose: PlainPose,
    iteration: usize,
    iterations: usize,
    warnings: Vec<String>,
    object_warnings: Vec<String>,
    /// How sure the pose is, where the method knows.
    confidence: Option<PosteriorSummary>,
    /// Kept only if something will be made of it: it is long.
    trace: Option<Trace>,
}

/// What a worker brings.
struct Done {
    refined: Refined,
    seconds: f64,
}

impl Run<'_> {
    pub(crate) fn run(&self) -> anyhow::Result<Outcome> {
        let dataset = self.selection.open()?;
        let (jobs, mut failures) = self.selection.jobs(self.poses)?;
        let assets = Mutex::new(Assets::new(&dataset, self.seed).with_cache(cache::open()));
        let mut report = self.report.map(Report::create).transpose()?;
        let (mut journal, mut refined): (_, BTreeMap<usize, Refined>) =
            Journal::open(&beside(self.out, "journal"), &self.identity(&dataset)?, self.restart)?;
        let mut times = Times::open(&beside(self.out, "times.csv"), !refined.is_empty())?;
        let open: Vec<(usize, &Job)> =
            jobs.iter().enumerate().filter(|(index, _)| !refined.contains_key(index)).collect();
        let mut failed: BTreeMap<usize, String> = BTreeMap::new();
        let mut introduced = BTreeSet::new();
        let bar = progress::bar(jobs.len() as u64, "refining");
        bar.set_position(refined.len() as u64);
        bar.reset_eta();
        self.workers(open.len())?.run(
            &open,
            || |(_, job): &(usize, &Job)| self.refine(&assets, job),
            |&(index, job), outcome| -> anyhow::Result<()> {
                match outcome {
                    Ok(done) => {
                        let id = job.row.obj_id;
                        if introduced.insert(id) {
                            for warning in &done.refined.object_warnings {
                                bar.suspend(|| {
                                    complain(format!("warning: object {id}: {warning}"))
                                });
                            }
                        }
                        for warning in &done.refined.warnings {
                            bar.suspend(|| {
                                complain(format!("warning: {}: {warning}", label(&job.row)))
                            });
                        }
                        // First the time: of a frame whose record is lost, a second line is no harm.
                        times.add(index, &label(&job.row), self.method, done.seconds)?;
                        refined.insert(index, journal.append(index, &done.refined)?);
                    }
                    // Not recorded: a resumed run tries again.
                    Err(error) => drop(failed.insert(index, error)),
                }
                bar.inc(1);
                Ok(())
            },
        )?;
        bar.finish_and_clear();
        failures.extend(failed.iter().map(|(&i, e)| format!("{}: {e}", label(&jobs[i].row))));
        let rows = self.rows(&jobs, &refined, &times);
        if rows.is_empty() {
            failures
                .push(format!("no pose could be refined, {} was not written", self.out.display()));
        } else {
            write_results(self.out, &rows)?;
            if !self.json {
                self.tell(rows.len(), &times)?;
            }
            if let Some(report) = &mut report {
                let faults = draw(report, &assets, &jobs, &refined, self.config);
                // A full disk must not cost the poses.
                failures.extend(faults);
            }
        }
        if self.json {
            let frames: Vec<_> = refined
                .iter()
                .map(|(&i, r)| summary(&jobs[i], r, times.of(i, self.method)))
                .collect();
            let document = json!({ "frames": frames, "failures": failures });
            say(format!("{document:#}"))?;
        }
        if let Some(report) = report.filter(|_| !rows.is_empty()) {
            match report.finish() {
                Ok(index) if !self.json => say(format!("report: open {}", index.display()))?,
                Ok(_) => {}
                Err(error) => failures.push(format!("report: {error}")),
            }
        }
        journal.discard()?;
        Ok(Outcome { done: rows.len(), failures })
    }

    /// Frames one a thread; to be timed, one after another with all threads.
    fn workers(&self, frames: usize) -> anyhow::Result<Workers> {
        let threads = self.threads.map_or_else(rayon::current_num_threads, NonZeroUsize::get);
        Ok(if self.time { Workers::together(threads)? } else { Workers::new(frames, threads)? })
    }

    fn keeps_trace(&self) -> bool {
        self.json || self.report.is_some()
    }

    fn identity(&self, dataset: &Dataset) -> anyhow::Result<Identity> {
        let Selection { scene, image, object, .. } = self.selection;
        let poses = self.poses;
        Ok(Identity::of(&json!({
            "command": "refine",
            "dataset": canonical(dataset.split_dir()),
            "annotations": dataset_fingerprint(dataset, &SENSED)?,
            "poses": file_fingerprint(poses)?,
            "filters": format!("scenes {scene:?} images {image:?} objects {object:?}"),
            "method": self.method,
            "settings": format!("{:?}", self.config),
            "seed": self.seed,
            "backend": "cpu",
            "history kept": self.keeps_trace(),
        })))
    }

    fn refine(&self, assets: &Mutex<Assets<'_>>, job: &Job) -> Result<Done, String> {
        self.try_refine(assets, job).map_err(|e| e.to_string()).and_then(|done| {
            let finite = done.refined.pose.is_finite();
            if finite { Ok(done) } else { Err("the refined pose is not finite".into()) }
        })
    }

    fn try_refine(&self, assets: &Mutex<Assets<'_>>, job: &Job) -> Result<Done, AssetError> {
        let row = &job.row;
        let (object, observation, robot) = {
            let mut assets = assets.lock().unwrap_or_else(PoisonError::into_inner);
            let object = assets.object(row.obj_id)?;
            let frame = assets.dataset().frame(row.scene_id, row.im_id)?;
            let (observation, robot) = assets.observation_for(&frame, job.instance, self.config)?;
            (object, observation, robot)
        };
        let robot = robot.as_ref();
        let start = Instant::now();
        let pose =
            refine_with(&observation, &object, robot, &row.t_cam_model, self.config, |_| true)?;
        let seconds = start.elapsed().as_secs_f64();
        let refined = Refined {
            pose: PlainPose::from(&pose.t_cam_object),
            iteration: pose.iteration,
            iterations: pose.trace.iterations.len().saturating_sub(1),
            warnings: inspect_pose(&observation, &object, robot.map(Arc::as_ref), &row.t_cam_model),
            object_warnings: inspect_object(&object),
            confidence: pose.confidence.as_ref().map(PosteriorSummary::from),
            trace: self.keeps_trace().then_some(pose.trace),
        };
        Ok(Done { refined, seconds })
    }

    fn rows(
        &self,
        jobs: &[Job],
        refined: &BTreeMap<usize, Refined>,
        times: &Times,
    ) -> Vec<ResultRow> {
        let row = |(&index, refined): (&usize, &Refined)| ResultRow {
            t_cam_model: (&refined.pose).into(),
            // BOP leaves open what a score is; here it is the probability of being right.
            score: refined.confidence.as_ref().map_or(jobs[index].row.score, |c| c.probability),
            time: times.of(index, self.method).filter(|_| self.time).unwrap_or(-1.0),
            ..jobs[index].row.clone()
        };
        let mut rows: Vec<ResultRow> = refined.iter().map(row).collect();
        share_image_times(&mut rows);
        rows
    }

    fn tell(&self, done: usize, times: &Times) -> anyhow::Result<()> {
        let mean = times.means().get(self.method).map_or(f64::NAN, |(mean, _)| *mean);
        say(format!("{done} poses refined in {mean:.2} s each, written to {}", self.out.display()))
    }
}

/// Draws all refined frames in their order; returns what went wrong.
fn draw(
    report: &mut Report,
    assets: &Mutex<Assets<'_>>,
    jobs: &[Job],
    refined: &BTreeMap<usize, Refined>,
    config: &Config,
) -> Vec<String> {
    let mut assets = assets.lock().unwrap_or_else(PoisonError::into_inner);
    let mut faults = Vec::new();
    for (&index, refined) in refined {
        let Job { row, instance } = &jobs[index];
        let mut drawn = || -> anyhow::Result<()> {
            let object = assets.object(row.obj_id)?;
            let frame = assets.dataset().frame(row.scene_id, row.im_id)?;
            let (observation, _) = assets.observation_for(&frame, *instance, config)?;
            let pose = RefinedPose {
                t_cam_object: (&refined.pose).into(),
                iteration: refined.iteration,
                trace: refined.trace.clone().unwrap_or_default(),
                confidence: None,
            };
            let frame = FrameReport::draw(&observation, &object, &row.t_cam_model, &pose);
            Ok(report.add(&label(row), &frame)?)
        };
        if let Err(error) = drawn() {
            faults.push(format!("{}: report: {error}", label(row)));
        }
    }
    faults
}

fn summary(job: &Job, refined: &Refined, seconds: Option<f64>) -> serde_json::Value {
    let t_mm = refined.pose.translation_m.map(|v| v * 1e3);
    let warnings: Vec<&String> = refined.object_warnings.iter().chain(&refined.warnings).collect();
    json!({
        "scene_id": job.row.scene_id,
        "im_id": job.row.im_id,
        "obj_id": job.row.obj_id,
        "seconds": seconds,
        "iteration": refined.iteration,
        "iterations": refined.iterations,
        "t_cam_model_mm": t_mm,
        "quaternion_wxyz": refined.pose.quaternion_wxyz,
        "warnings": warnings,
        "confidence": refined.confidence,
        "trace": refined.trace,
    })
}
