//! `prehend refine --dataset`: many frames, side by side, resumable.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Isometry3;
use prehend_refine::check::Warning;
use prehend_refine::data::bop::{Dataset, DatasetError, ReadResults, ResultRow, read_results};
use prehend_refine::data::details::{FrameDetails, write_details};
use prehend_refine::data::identity::{SENSED, canonical, dataset_fingerprint, file_fingerprint};
use prehend_refine::data::{AssetError, Assets, Identity, Journal, PlainPose, Sensor, Times};
use prehend_refine::evaluate::Scorer;
use prehend_refine::evaluate::report::{FrameDrawing, FrameReport, Report};
use prehend_refine::strategy::{DiagnosisSummary, PosteriorSummary, Trace};
use prehend_refine::{Method, Workers, guard};
use prehend_render::Backend;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::Refine;
use super::options::record;
use crate::options::{Job, Selection, beside, open_rig, write_poses};
use crate::report;
use crate::terminal::{cache, exit_code, progress, say, warn};

/// A refinement of a dataset's frames.
pub(super) struct DatasetRun<'a> {
    pub(super) options: &'a Refine,
    pub(super) selection: &'a Selection,
    pub(super) poses: &'a Path,
    /// Alternatives of the poses, where these come from a search.
    pub(super) hypotheses: Option<PathBuf>,
    pub(super) out: &'a Path,
    /// The method that the options make.
    pub(super) method: Method,
    /// The device that renders.
    pub(super) backend: Arc<dyn Backend>,
}

/// A refined frame as the journal has it.
#[derive(Serialize, Deserialize)]
struct RefinedFrame {
    pose: PlainPose,
    iteration: usize,
    iterations: usize,
    warnings: Vec<String>,
    object_warnings: Vec<String>,
    /// How sure the pose is, where the method knows.
    confidence: Option<PosteriorSummary>,
    /// What is found without each sensor, if that was asked.
    #[serde(default)]
    diagnosis: Vec<DiagnosisSummary>,
    /// Kept only if something will be made of it: it is long.
    trace: Option<Trace>,
}

impl RefinedFrame {
    fn all_warnings(&self) -> Vec<String> {
        self.object_warnings.iter().chain(&self.warnings).cloned().collect()
    }
}

impl DatasetRun<'_> {
    pub(super) fn run(&self) -> anyhow::Result<ExitCode> {
        let Refine { masks, neighbors, rig, output, method, .. } = self.options;
        let (name, json) = (method.method(), output.json);
        let dataset = self.selection.open()?;
        let hypotheses = self.hypotheses.as_deref();
        let (jobs, mut failures) = self.selection.jobs_with_hypotheses(self.poses, hypotheses)?;
        let assets = Assets::new(&dataset, method.seed).with_cache(cache());
        let mut assets = assets.with_rig(open_rig(rig.as_deref())?).with_masks(masks.source()?);
        if let Some(file) = neighbors {
            let ReadResults { rows, errors, .. } = read_results(file)?;
            failures.extend(errors.iter().map(|error| format!("{}: {error}", file.display())));
            assets = assets.with_neighbors(&rows);
        }
        let assets = Mutex::new(assets);
        let create = |folder| Report::create(folder, "Refined poses");
        let report = output.report.as_deref().map(create).transpose()?;
        let journal = beside(self.out, "journal");
        let (mut journal, mut refined): (_, BTreeMap<usize, RefinedFrame>) =
            Journal::open(&journal, &self.identity(&dataset)?, output.restart)?;
        let mut times = Times::open(&beside(self.out, "times.csv"), !refined.is_empty())?;
        let open: Vec<(usize, &Job)> =
            jobs.iter().enumerate().filter(|(index, _)| !refined.contains_key(index)).collect();
        let mut failed: BTreeMap<usize, anyhow::Error> = BTreeMap::new();
        let mut introduced = BTreeSet::new();
        let bar = progress(jobs.len(), "refining");
        bar.set_position(refined.len() as u64);
        bar.reset_eta();
        // To be timed, frames come one after another, each with all threads.
        let workers = if output.time { 1 } else { open.len() };
        Workers::new(workers, rayon::current_num_threads())?.run(
            &open,
            || |(_, job): &(usize, &Job)| guard(|| self.refine(&assets, job)),
            |&(index, job), outcome| -> anyhow::Result<()> {
                match outcome {
                    Ok((done, seconds)) => {
                        let target = job.target;
                        if introduced.insert(target.obj_id) {
                            let object = format!("object {}", target.obj_id);
                            done.object_warnings.iter().for_each(|w| warn(&bar, &object, w));
                        }
                        done.warnings.iter().for_each(|w| warn(&bar, target, w));
                        if !json {
                            let lines = done.diagnosis.iter().map(|d| format!("{target}: {d}"));
                            bar.suspend(|| lines.into_iter().try_for_each(say))?;
                        }
                        // First the time: of a frame whose record is lost, a second line is no harm.
                        times.add(index, &target.to_string(), name, seconds)?;
                        refined.insert(index, journal.append(index, &done)?);
                    }
                    // Not recorded: a resumed run tries again.
                    Err(error) => drop(failed.insert(index, error)),
                }
                bar.inc(1);
                Ok(())
            },
        )?;
        bar.finish_and_clear();
        failures.extend(failed.iter().map(|(&i, e)| format!("{}: {e}{}", jobs[i].target, hint(e))));
        let seconds = |index: usize| times.of(index, name);
        // Files have no times unless asked: a resumed run would not end with the same ones.
        let timed = |index| seconds(index).filter(|_| output.time);
        let row = |(&index, refined): (&usize, &RefinedFrame)| ResultRow {
            t_cam_model: (&refined.pose).into(),
            // BOP leaves open what a score is; here it is the probability of being right, and that of the initial pose where the method knows none.
            score: refined.confidence.as_ref().map_or(jobs[index].row.score, |c| c.probability),
            time: timed(index).unwrap_or(-1.0),
            ..jobs[index].row.clone()
        };
        let rows: Vec<ResultRow> = refined.iter().map(row).collect();
        let count = rows.len();
        write_poses(self.out, rows, &mut failures)?;
        if count > 0 {
            if !json {
                let mean = times.means().get(name).map_or(f64::NAN, |(mean, _)| *mean);
                let out = self.out.display();
                say(format!("{count} poses refined in {mean:.2} s each, written to {out}"))?;
            }
            // A full disk must not cost the poses.
            if let Some(Err(error)) = output.details.as_deref().map(|file| {
                let details = |(&i, r): (&usize, &RefinedFrame)| details(&jobs[i], r, timed(i));
                write_details(file, &refined.iter().map(details).collect::<Vec<_>>())
            }) {
                failures.push(format!("--details: {error}"));
            }
            let draw =
                |r| self.draw(r, (&dataset, &assets), &jobs, (&refined, &timed), &mut failures);
            match report.map(draw) {
                Some(Ok(page)) if !json => say(format!("report: open {}", page.display()))?,
                Some(Err(error)) => failures.push(format!("report: {error}")),
                _ => {}
            }
        }
        if json {
            let frames: Vec<_> =
                refined.iter().map(|(&i, r)| summary(&jobs[i], r, seconds(i))).collect();
            let settings = record(&self.method)?;
            let document = json!({ "frames": frames, "failures": failures, "settings": settings });
            say(format!("{document:#}"))?;
        }
        journal.discard()?;
        Ok(exit_code(count, &failures))
    }

    fn keeps_trace(&self) -> bool {
        self.options.output.json || self.options.output.report.is_some()
    }

    fn identity(&self, dataset: &Dataset) -> anyhow::Result<Identity> {
        let Refine { masks, neighbors, rig, output, method, .. } = self.options;
        let fingerprint =
            |file: &Option<PathBuf>| file.as_deref().map(file_fingerprint).transpose();
        Ok(Identity::of(&json!({
            "command": "refine",
            "dataset": canonical(dataset.split_dir()),
            "annotations": dataset_fingerprint(dataset, &SENSED)?,
            "poses": file_fingerprint(self.poses)?,
            "hypotheses": fingerprint(&self.hypotheses)?,
            "masks": masks.identity()?,
            "neighbors": fingerprint(neighbors)?,
            "rig": fingerprint(rig)?,
            "filters": self.selection.filters(),
            "method": method.method(),
            "settings": record(&self.method)?,
            "seed": method.seed,
            "backend": self.backend.name(),
            "history kept": self.keeps_trace(),
            "diagnosed": output.diagnose,
        })))
    }

    /// Refines one frame; also returns the seconds that it took.
    fn refine(&self, assets: &Mutex<Assets>, job: &Job) -> anyhow::Result<(RefinedFrame, f64)> {
        let input = {
            let mut assets = assets.lock().unwrap_or_else(PoisonError::into_inner);
            assets.load(
                &job.target,
                Some(&job.row.t_cam_model),
                &Sensor::required_by(&self.method),
            )?
        };
        let estimator = input.estimator(&self.method).backend(Arc::clone(&self.backend));
        let hypotheses = job.hypotheses();
        let frame = &input.frame;
        let refined = estimator.run(frame, &hypotheses, &mut |_| ControlFlow::Continue(()))?;
        let diagnosis = match self.options.output.diagnose {
            true => DiagnosisSummary::of(&estimator.diagnose(&refined, &hypotheses)?),
            false => Vec::new(),
        };
        let [object_warnings, warnings] = refined.input.warnings(&hypotheses.best);
        let found = refined.estimate;
        let texts = |warnings: Vec<Warning>| warnings.iter().map(Warning::to_string).collect();
        let entry = RefinedFrame {
            pose: PlainPose::from(found.t_cam_object()),
            iteration: found.iteration,
            iterations: found.trace.iterations.len().saturating_sub(1),
            warnings: texts(warnings),
            object_warnings: texts(object_warnings),
            confidence: found.posterior.as_ref().map(PosteriorSummary::from),
            diagnosis,
            trace: self.keeps_trace().then_some(found.trace),
        };
        Ok((entry, refined.seconds))
    }

    /// Reports all refined frames in their order and returns the page; of frames that cannot be drawn `failures` hears.
    fn draw(
        &self,
        mut report: Report,
        (dataset, assets): (&Dataset, &Mutex<Assets>),
        jobs: &[Job],
        (refined, seconds): (&BTreeMap<usize, RefinedFrame>, &dyn Fn(usize) -> Option<f64>),
        failures: &mut Vec<String>,
    ) -> Result<PathBuf, DatasetError> {
        let mut assets = assets.lock().unwrap_or_else(PoisonError::into_inner);
        let scorer = Scorer::new(dataset);
        report.add_fact("dataset", dataset.split_dir().display().to_string());
        report.add_fact("method", self.options.method.method());
        report.add_fact("version", env!("CARGO_PKG_VERSION"));
        let is_fused = matches!(self.method, Method::Fused(_));
        let drawn = least_sure(refined);
        if drawn.len() < refined.len() {
            report.add_fact("drawn", format!("the {DRAWN} least sure frames"));
        }
        let bar = progress(refined.len(), "reporting");
        for (&index, refined) in bar.wrap_iter(refined.iter()) {
            let job = &jobs[index];
            let (mut frame, fault) = frame_report(&scorer, job, refined, seconds(index));
            let t_cam_object = (&refined.pose).into();
            let mut draw = || -> Result<_, AssetError> {
                let initial = &job.row.t_cam_model;
                let required = Sensor::required_by(&self.method);
                let input = assets.load(&job.target, Some(initial), &required)?;
                report.draw(&FrameDrawing {
                    input: &input.estimator(&self.method).input(&input.frame, initial)?,
                    initial: Some(initial),
                    t_cam_object: &t_cam_object,
                    covariance: refined.confidence.as_ref().map(|c| &c.covariance),
                    // Stages of the fused method minimize other losses each.
                    trace: refined.trace.as_ref().filter(|_| !is_fused),
                })
            };
            let mut failed = |e| failures.push(format!("{}: report: {e}", job.target));
            let drawing = drawn.contains(&index).then(&mut draw).transpose();
            frame.drawing = drawing.map_err(&mut failed).unwrap_or_default();
            fault.map(failed);
            report.add_frame(frame);
        }
        report.finish()
    }
}

/// Advice where there is no mask.
fn hint(error: &anyhow::Error) -> &'static str {
    match error.downcast_ref() {
        Some(AssetError::Dataset(DatasetError::NoMask { .. })) => {
            " (--mask-source none does without)"
        }
        _ => "",
    }
}

/// Frames that are drawn at most: pages stay small enough to be opened.
const DRAWN: usize = 200;

/// Frames that are drawn: all, or those whose poses are the least probable.
fn least_sure(refined: &BTreeMap<usize, RefinedFrame>) -> BTreeSet<usize> {
    let probability = |r: &RefinedFrame| r.confidence.as_ref().map_or(0.0, |c| c.probability);
    let mut all: Vec<(f64, usize)> = refined.iter().map(|(k, r)| (probability(r), *k)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all.into_iter().take(DRAWN).map(|(_, index)| index).collect()
}

/// A row of the report, and why its error is not known where that is a fault.
fn frame_report(
    scorer: &Scorer<'_>,
    job: &Job,
    refined: &RefinedFrame,
    seconds: Option<f64>,
) -> (FrameReport, Option<AssetError>) {
    let (initial, pose) = (job.row.t_cam_model, Isometry3::from(&refined.pose));
    let errors = [pose, initial]
        .map(|t_cam_model| scorer.pose_error(&ResultRow { t_cam_model, ..job.row.clone() }));
    let mut fault = None;
    let [error, initial_error] = errors.map(|error| {
        error.unwrap_or_else(|e| {
            fault = Some(e);
            None
        })
    });
    let confidence = refined.confidence.as_ref();
    let mut figures = report::pose_figures(error, confidence);
    let moved = (pose.translation.vector - initial.translation.vector).norm();
    figures.extend([
        (report::MOVED, Some(1e3 * moved)),
        (report::TURNED, Some(pose.rotation.angle_to(&initial.rotation).to_degrees())),
        (report::INITIAL_ERROR, initial_error.map(|[meters, _]| 1e3 * meters)),
        (report::INITIAL_TURN, initial_error.map(|[_, radians]| radians.to_degrees())),
        (report::SECONDS, seconds),
        (report::ITERATIONS, Some(refined.iterations as f64)),
    ]);
    let mut remarks = refined.all_warnings();
    let mut flags = confidence.map_or_else(Vec::new, report::flags);
    if !remarks.is_empty() {
        flags.push("warning".to_owned());
    }
    remarks.extend(refined.diagnosis.iter().map(DiagnosisSummary::to_string));
    let posterior = refined.confidence.clone();
    let (name, status) = (job.target.to_string(), String::new());
    (FrameReport { name, status, flags, remarks, figures, posterior, drawing: None }, fault)
}

/// What the table has of a frame.
fn details(job: &Job, refined: &RefinedFrame, seconds: Option<f64>) -> FrameDetails {
    FrameDetails {
        target: job.target,
        t_cam_model: (&refined.pose).into(),
        initial: Some(job.row.t_cam_model),
        posterior: refined.confidence.clone(),
        iterations: refined.iterations,
        seconds,
        warnings: refined.all_warnings(),
        track: None,
    }
}

fn summary(job: &Job, refined: &RefinedFrame, seconds: Option<f64>) -> serde_json::Value {
    let t_mm = refined.pose.translation_m.map(|v| v * 1e3);
    json!({
        "scene_id": job.row.scene_id,
        "im_id": job.row.im_id,
        "obj_id": job.row.obj_id,
        "seconds": seconds,
        "iteration": refined.iteration,
        "iterations": refined.iterations,
        "t_cam_model_mm": t_mm,
        "quaternion_wxyz": refined.pose.quaternion_wxyz,
        "warnings": refined.all_warnings(),
        "confidence": refined.confidence,
        "diagnosis": refined.diagnosis,
        "trace": refined.trace,
    })
}
