//! `prehend refine --dataset`: many frames, side by side, resumable.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};

use prehend_refine::data::bop::{Dataset, DatasetError, ReadResults, ResultRow, read_results};
use prehend_refine::data::details::{FrameDetails, write_details};
use prehend_refine::data::identity::{SENSED, canonical, dataset_fingerprint, file_fingerprint};
use prehend_refine::data::{AssetError, Assets, Identity, Journal, write_times};
use prehend_refine::evaluate::Scorer;
use prehend_refine::evaluate::report::{FrameDrawing, Report, least_sure};
use prehend_refine::strategy::DiagnosisSummary;
use prehend_refine::{Method, Workers, guard};
use prehend_render::Backend;
use serde_json::json;

use super::Refine;
use super::options::record;
use super::refined::RefinedFrame;
use crate::failures::Failures;
use crate::options::{Job, Selection, advice, beside, open_rig, write_poses};
use crate::terminal::{cache, progress, say, warn};

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

impl DatasetRun<'_> {
    pub(super) fn run(&self) -> anyhow::Result<ExitCode> {
        let Refine { masks, neighbors, rig, output, method, .. } = self.options;
        let (name, json) = (method.method(), output.json);
        let Self { selection, poses, .. } = *self;
        let dataset = selection.open()?;
        let hypotheses = self.hypotheses.as_deref();
        let (jobs, mut failures) = selection.jobs(poses, hypotheses)?;
        let assets = Assets::new(&dataset, method.seed).with_cache(cache());
        let mut assets = assets.with_rig(open_rig(rig.as_deref())?).with_masks(masks.source()?);
        if let Some(file) = neighbors {
            let ReadResults { rows, errors, .. } = read_results(file)?;
            failures.add_rows(file, &errors);
            assets = assets.with_neighbors(&rows);
        }
        let assets = Mutex::new(assets);
        let create = |folder| Report::create(folder, "Refined poses");
        let report = output.report.as_deref().map(create).transpose()?;
        let journal = beside(self.out, "journal");
        let (mut journal, mut refined): (_, BTreeMap<usize, RefinedFrame>) =
            Journal::open(&journal, &self.identity(&dataset)?, output.restart)?;
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
                    Ok(done) => {
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
        for (&index, error) in &failed {
            let advice = error.downcast_ref().map_or("", advice);
            failures.add(format!("{}: {error}{advice}", jobs[index].target));
        }
        let frames: Vec<(&Job, &RefinedFrame)> =
            refined.iter().map(|(&index, frame)| (&jobs[index], frame)).collect();
        let rows: Vec<ResultRow> =
            frames.iter().map(|(job, frame)| frame.row(job, output.time)).collect();
        let count = rows.len();
        write_poses(self.out, rows, &mut failures)?;
        if count > 0 {
            let times = refined.iter().map(|(&k, r)| (k, jobs[k].target.to_string(), r.seconds));
            failures.keep("times", write_times(&beside(self.out, "times.csv"), name, times));
            if !json {
                let mean = refined.values().map(|r| r.seconds).sum::<f64>() / count as f64;
                let out = self.out.display();
                say(format!("{count} poses refined in {mean:.2} s each, written to {out}"))?;
            }
            // A full disk must not cost the poses.
            if let Some(file) = &output.details {
                let rows = frames.iter().map(|(job, frame)| frame.details(job, output.time));
                let rows: Vec<FrameDetails> = rows.collect();
                failures.keep("--details", write_details(file, &rows));
            }
            if let Some(report) = report {
                let page = self.draw(report, (&dataset, &assets), &frames, &mut failures);
                if let Some(page) = failures.keep("report", page).filter(|_| !json) {
                    say(format!("report: open {}", page.display()))?;
                }
            }
        }
        if json {
            let frames: Vec<_> = frames.iter().map(|(job, frame)| frame.summary(job)).collect();
            let settings = record(&self.method)?;
            let document = json!({ "frames": frames, "failures": failures, "settings": settings });
            say(format!("{document:#}"))?;
        }
        journal.discard()?;
        Ok(failures.exit_code(count))
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

    /// Refines one frame.
    fn refine(&self, assets: &Mutex<Assets>, job: &Job) -> anyhow::Result<RefinedFrame> {
        let input = {
            let mut assets = assets.lock().unwrap_or_else(PoisonError::into_inner);
            assets.load(&job.target, Some(&job.row.t_cam_model), self.method.gradients())?
        };
        let estimator = input.estimator(&self.method).backend(Arc::clone(&self.backend));
        let (frame, hypotheses) = (&input.frame, &job.hypotheses);
        let refined = estimator.run(frame, hypotheses, &mut |_| ControlFlow::Continue(()))?;
        let diagnosis = match self.options.output.diagnose {
            true => DiagnosisSummary::of(&estimator.diagnose(&refined, hypotheses)?),
            false => Vec::new(),
        };
        let mut frame = RefinedFrame { diagnosis, ..RefinedFrame::new(refined, &hypotheses.best) };
        frame.trace.take_if(|_| !self.keeps_trace());
        Ok(frame)
    }

    /// Reports all refined frames in their order and returns the page; of frames that cannot be drawn `failures` hears.
    fn draw(
        &self,
        mut report: Report,
        (dataset, assets): (&Dataset, &Mutex<Assets>),
        frames: &[(&Job, &RefinedFrame)],
        failures: &mut Failures,
    ) -> Result<PathBuf, DatasetError> {
        let mut assets = assets.lock().unwrap_or_else(PoisonError::into_inner);
        let scorer = Scorer::new(dataset);
        report.add_fact("dataset", dataset.split_dir().display().to_string());
        report.add_fact("method", self.options.method.method());
        report.add_fact("version", env!("CARGO_PKG_VERSION"));
        let is_fused = matches!(self.method, Method::Fused(_));
        let probability = |(_, refined): &(&Job, &RefinedFrame)| {
            refined.confidence.as_ref().map_or(0.0, |confidence| confidence.probability)
        };
        let drawn = least_sure(frames.iter().map(probability));
        if drawn.len() < frames.len() {
            report.add_fact("drawn", format!("the {} least sure frames", drawn.len()));
        }
        let bar = progress(frames.len(), "reporting");
        for (index, (job, refined)) in bar.wrap_iter(frames.iter().enumerate()) {
            let (initial, pose) = (job.row.t_cam_model, (&refined.pose).into());
            let mut draw = || -> Result<_, AssetError> {
                let required = self.method.gradients();
                let input = assets.load(&job.target, Some(&initial), required)?;
                report.draw(&FrameDrawing {
                    input: &input.estimator(&self.method).input(&input.frame, &initial)?,
                    initial: Some(&initial),
                    t_cam_object: &pose,
                    covariance: refined.confidence.as_ref().map(|c| &c.covariance),
                    // Stages of the fused method minimize other losses each.
                    trace: refined.trace.as_ref().filter(|_| !is_fused),
                })
            };
            let name = format!("{}: report", job.target);
            let drawing = drawn.contains(&index).then(&mut draw);
            let drawing = drawing.and_then(|drawing| failures.keep(&name, drawing));
            let error =
                |t_cam_model| scorer.pose_error(&ResultRow { t_cam_model, ..job.row.clone() });
            // What is wrong with the truth is told once.
            let errors = [failures.keep(&name, error(pose)), error(initial).ok()];
            let errors = errors.map(Option::flatten);
            report.add_frame(refined.report(job, errors, self.options.output.time, drawing));
        }
        report.finish()
    }
}
