//! `prehend refine --dataset`: many frames, side by side, resumable.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::path::Path;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use anyhow::bail;
use prehend_refine::data::bop::{Dataset, ResultRow, share_image_times, write_results};
use prehend_refine::data::identity::{SENSED, canonical, dataset_fingerprint, file_fingerprint};
use prehend_refine::data::{
    AssetError, Assets, Identity, Journal, PlainPose, Sensor, Times, Workers,
};
use prehend_refine::evaluate::report::{FrameReport, Report};
use prehend_refine::scene::{inspect_object, inspect_pose};
use prehend_refine::strategy::{PosteriorSummary, Trace};
use prehend_refine::{Frame, Method, refine};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::options::{MethodOptions, OutputOptions};
use crate::options::{Input, Job, beside, label};
use crate::terminal::{cache, complain, exit_code, progress, say};

/// A refinement of a dataset's frames.
pub(super) struct DatasetRun<'a> {
    input: &'a Input,
    output: &'a OutputOptions,
    out: &'a Path,
    /// Name of the method in the file of times.
    name: &'a str,
    method: Method,
    required: Vec<Sensor>,
    seed: u64,
    threads: usize,
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

impl<'a> DatasetRun<'a> {
    pub(super) fn new(
        input: &'a Input,
        output: &'a OutputOptions,
        options: &'a MethodOptions,
    ) -> anyhow::Result<Self> {
        let Some(out) = &output.out else { bail!("--out: is missing") };
        let method = options.configured()?;
        let threads = options.threads.map_or_else(rayon::current_num_threads, NonZeroUsize::get);
        Ok(Self {
            input,
            output,
            out,
            name: options.method().name,
            required: Sensor::required_by(&method),
            method,
            seed: options.seed,
            threads,
        })
    }

    pub(super) fn run(&self) -> anyhow::Result<ExitCode> {
        let dataset = self.input.open()?;
        let (jobs, mut failures) = self.input.jobs()?;
        let assets = Mutex::new(Assets::new(&dataset, self.seed).with_cache(cache()));
        let mut report = self.output.report.as_deref().map(Report::create).transpose()?;
        let (mut journal, mut refined): (_, BTreeMap<usize, Refined>) = {
            let journal = beside(self.out, "journal");
            Journal::open(&journal, &self.identity(&dataset)?, self.output.restart)?
        };
        let mut times = Times::open(&beside(self.out, "times.csv"), !refined.is_empty())?;
        let open: Vec<(usize, &Job)> =
            jobs.iter().enumerate().filter(|(index, _)| !refined.contains_key(index)).collect();
        let mut failed: BTreeMap<usize, String> = BTreeMap::new();
        let mut introduced = BTreeSet::new();
        let bar = progress(jobs.len(), "refining");
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
                        times.add(index, &label(&job.row), self.name, done.seconds)?;
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
            if !self.output.json {
                self.tell(rows.len(), &times)?;
            }
            if let Some(report) = &mut report {
                // A full disk must not cost the poses.
                failures.extend(self.draw(report, &assets, &jobs, &refined));
            }
        }
        if self.output.json {
            let frames: Vec<_> = refined
                .iter()
                .map(|(&i, r)| summary(&jobs[i], r, times.of(i, self.name)))
                .collect();
            let document = json!({ "frames": frames, "failures": failures });
            say(format!("{document:#}"))?;
        }
        if let Some(report) = report.filter(|_| !rows.is_empty()) {
            match report.finish() {
                Ok(index) if !self.output.json => say(format!("report: open {}", index.display()))?,
                Ok(_) => {}
                Err(error) => failures.push(format!("report: {error}")),
            }
        }
        journal.discard()?;
        Ok(exit_code(rows.len(), &failures))
    }

    /// Frames one a thread; to be timed, one after another with all threads.
    fn workers(&self, frames: usize) -> anyhow::Result<Workers> {
        let workers = if self.output.time { 1 } else { frames };
        Ok(Workers::new(workers, self.threads)?)
    }

    fn keeps_trace(&self) -> bool {
        self.output.json || self.output.report.is_some()
    }

    fn identity(&self, dataset: &Dataset) -> anyhow::Result<Identity> {
        Ok(Identity::of(&json!({
            "command": "refine",
            "dataset": canonical(dataset.split_dir()),
            "annotations": dataset_fingerprint(dataset, &SENSED)?,
            "poses": file_fingerprint(&self.input.poses)?,
            "filters": self.input.selection.filters(),
            "method": self.name,
            "settings": format!("{:?}", self.method),
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
        let (object, observation, hand) = {
            let mut assets = assets.lock().unwrap_or_else(PoisonError::into_inner);
            let object = assets.object(row.obj_id)?;
            let frame = assets.dataset().frame(row.scene_id, row.im_id)?;
            let (observation, hand) = assets.observation(&frame, job.instance, &self.required)?;
            (object, observation, hand)
        };
        let hand = hand.as_ref();
        let start = Instant::now();
        let frame = Frame::new(&observation, &object, hand)?;
        let found = refine(&frame, &row.t_cam_model, &self.method)?;
        let seconds = start.elapsed().as_secs_f64();
        let refined = Refined {
            pose: PlainPose::from(found.t_cam_object()),
            iteration: found.iteration,
            iterations: found.trace.iterations.len().saturating_sub(1),
            warnings: inspect_pose(&observation, &object, hand.map(Arc::as_ref), &row.t_cam_model),
            object_warnings: inspect_object(&object),
            confidence: found.posterior.as_ref().map(PosteriorSummary::from),
            trace: self.keeps_trace().then_some(found.trace),
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
            time: times.of(index, self.name).filter(|_| self.output.time).unwrap_or(-1.0),
            ..jobs[index].row.clone()
        };
        let mut rows: Vec<ResultRow> = refined.iter().map(row).collect();
        share_image_times(&mut rows);
        rows
    }

    fn tell(&self, done: usize, times: &Times) -> anyhow::Result<()> {
        let mean = times.means().get(self.name).map_or(f64::NAN, |(mean, _)| *mean);
        say(format!("{done} poses refined in {mean:.2} s each, written to {}", self.out.display()))
    }

    /// Draws all refined frames in their order; returns what went wrong.
    fn draw(
        &self,
        report: &mut Report,
        assets: &Mutex<Assets<'_>>,
        jobs: &[Job],
        refined: &BTreeMap<usize, Refined>,
    ) -> Vec<String> {
        let mut assets = assets.lock().unwrap_or_else(PoisonError::into_inner);
        let mut faults = Vec::new();
        for (&index, refined) in refined {
            let Job { row, instance } = &jobs[index];
            let mut drawn = || -> anyhow::Result<()> {
                let object = assets.object(row.obj_id)?;
                let frame = assets.dataset().frame(row.scene_id, row.im_id)?;
                let (observation, _) = assets.observation(&frame, *instance, &self.required)?;
                let pose = (&(&refined.pose).into(), refined.iteration);
                let trace = refined.trace.clone().unwrap_or_default();
                let initial = &row.t_cam_model;
                let frame = FrameReport::draw(&observation, &object, initial, pose, &trace);
                Ok(report.add(&label(row), &frame)?)
            };
            if let Err(error) = drawn() {
                faults.push(format!("{}: report: {error}", label(row)));
            }
        }
        faults
    }
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
