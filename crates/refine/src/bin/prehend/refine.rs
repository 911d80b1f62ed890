//! `prehend refine`.

use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::bail;
use clap::Args;
use prehend_refine::bop::{ResultRow, check_writable, share_image_times, write_results};
use prehend_refine::report::{FrameReport, Report};
use prehend_refine::{
    self as refine, AssetError, Assets, Config, RefinedPose, StrategyKind, TermKind,
    inspect_object, inspect_pose, refine_with,
};
use serde_json::json;

use crate::options::{Job, Selection, label};
use crate::outcome::Outcome;
use crate::output::say;
use crate::{frame, progress};

#[derive(Args)]
#[command(
    override_usage = "prehend refine --dataset <DIR> --poses <FILE> --out <FILE> [OPTIONS]\n       \
                            prehend refine --frame <FILE> [OPTIONS]"
)]
#[command(mut_arg("dataset", |a| a.required(false).required_unless_present("frame")))]
pub(crate) struct Arguments {
    #[command(flatten)]
    selection: Option<Selection>,
    /// Poses on the dataset's images, as a BOP results file
    #[arg(long, value_name = "FILE", required_unless_present = "frame", help_heading = "Input")]
    poses: Option<PathBuf>,
    /// Instead of a dataset, one frame described by a JSON file (see docs/FRAME.md)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["Selection", "poses", "report"], help_heading = "Input")]
    frame: Option<PathBuf>,
    /// Write the refined poses here: a BOP results file, or JSON with --frame (then optional)
    ///
    /// The file appears whole or not at all, once all frames are done; an existing one is replaced.
    #[arg(long, value_name = "FILE", required_unless_present = "frame", help_heading = "Output")]
    out: Option<PathBuf>,
    /// Write a web page here, with pictures of the poses before and after and loss curves
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    report: Option<PathBuf>,
    /// Print JSON on standard output: poses, times, loss curves and failures
    #[arg(long, help_heading = "Output")]
    json: bool,
    #[command(flatten)]
    method: Method,
    /// Worker threads; the poses are the same for any number [default: all cores]
    #[arg(long, value_name = "N", help_heading = "Method")]
    threads: Option<NonZeroUsize>,
}

/// How to refine.
#[derive(Args)]
pub(crate) struct Method {
    /// How to refine, with settings that the options below change
    #[arg(
        long,
        value_name = "NAME",
        default_value = "combined",
        value_parser = named,
        long_help = method_help(),
        help_heading = "Method"
    )]
    method: &'static refine::Method,
    /// Iterations at most; the search ends earlier when the steps become negligible
    /// [default: 400; robust-icp: 60]
    #[arg(long, value_name = "N", help_heading = "Method")]
    iterations: Option<usize>,
    /// Run all the iterations, however small the steps become
    #[arg(long, help_heading = "Method")]
    exhaustive: bool,
    /// Evidence to use, a list of physics, rendering, depth and tactile such as "rendering,depth"
    /// [default: the method's; with --frame, of those what the frame brings]
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Method")]
    terms: Option<Vec<TermKind>>,
    /// Return the last pose instead of the one whose rendering fits best
    #[arg(long, help_heading = "Method")]
    no_checkpoint: bool,
    /// Seed of the points sampled on the object's surface
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Method")]
    seed: u64,
}

/// The method called `name`.
fn named(name: &str) -> Result<&'static refine::Method, String> {
    refine::Method::named(name).ok_or_else(|| {
        let names: Vec<_> = refine::Method::all().iter().map(|m| m.name).collect();
        format!("unknown method: one of {}", names.join(", "))
    })
}

/// What `--help` says of the methods.
fn method_help() -> String {
    let mut text = "How to refine, with settings that the options below change:\n".to_owned();
    for method in refine::Method::all() {
        text += &format!("\n  {:<19} {}", method.name, method.summary);
    }
    text
}

impl Method {
    /// The settings of the method, changed by the other options.
    pub(crate) fn config(&self) -> anyhow::Result<Config> {
        let mut config = self.method.config();
        if let Some(terms) = &self.terms {
            if config.strategy != StrategyKind::Heuristic {
                bail!("--terms: the method {} uses depth alone", self.method.name);
            }
            config.terms.clone_from(terms);
        }
        if self.no_checkpoint {
            config.checkpoint = false;
        }
        if let Some(iterations) = self.iterations {
            config.set_iterations(iterations);
        }
        if self.exhaustive {
            config.set_exhaustive();
        }
        Ok(config)
    }

    pub(crate) fn seed(&self) -> u64 {
        self.seed
    }

    pub(crate) fn terms_given(&self) -> bool {
        self.terms.is_some()
    }
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    // What cannot be written must be known before the work, not after it.
    if let Some(out) = &arguments.out {
        check_writable(out)?;
    }
    if let Some(threads) = arguments.threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads.get()).build_global()?;
    }
    let Arguments { frame, selection, poses, out, .. } = arguments;
    match (frame, selection, poses, out) {
        (Some(file), ..) => frame::run(file, &arguments.method, out.as_deref(), arguments.json),
        (None, Some(selection), Some(poses), Some(out)) => {
            dataset_run(arguments, selection, poses, out)
        }
        _ => bail!("give --dataset, --poses and --out, or --frame"),
    }
}

fn dataset_run(
    arguments: &Arguments,
    selection: &Selection,
    poses: &Path,
    out: &Path,
) -> anyhow::Result<Outcome> {
    let dataset = selection.open()?;
    let (jobs, mut failures) = selection.jobs(poses)?;
    let method = &arguments.method;
    let config = method.config()?;
    let mut assets = Assets::new(&dataset, method.seed());
    let mut report = arguments.report.as_deref().map(Report::create).transpose()?;
    let mut rows = Vec::new();
    let mut outcomes = Vec::new();
    let mut introduced = BTreeSet::new();
    let bar = progress::bar(jobs.len() as u64, "refining");
    for job in &jobs {
        match refine_job(&mut assets, job, &config, report.is_some()) {
            Ok(done) => {
                let id = job.row.obj_id;
                if introduced.insert(id) {
                    let warnings = done.object_warnings.iter();
                    warnings.for_each(|w| bar.suspend(|| eprintln!("warning: object {id}: {w}")));
                }
                for warning in &done.warnings {
                    bar.suspend(|| eprintln!("warning: {}: {warning}", label(&job.row)));
                }
                outcomes.push(summary(job, &done));
                if let (Some(report), Some(frame)) = (&mut report, &done.report) {
                    // A full disk must not cost the poses.
                    if let Err(error) = report.add(&label(&job.row), frame) {
                        failures.push(format!("{}: report: {error}", label(&job.row)));
                    }
                }
                rows.push(ResultRow {
                    t_cam_model: done.pose.t_cam_object,
                    time: done.seconds,
                    ..job.row.clone()
                });
            }
            Err(error) => failures.push(format!("{}: {error}", label(&job.row))),
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    let done = rows.len();
    if done > 0 {
        let seconds: f64 = rows.iter().map(|r| r.time).sum();
        share_image_times(&mut rows);
        write_results(out, &rows)?;
        if !arguments.json {
            let mean = seconds / done as f64;
            let file = out.display();
            say(format!("{done} poses refined in {mean:.2} s each, written to {file}"))?;
        }
        if let Some(report) = report {
            match report.finish() {
                Ok(index) if !arguments.json => say(format!("report: open {}", index.display()))?,
                Ok(_) => {}
                Err(error) => failures.push(format!("report: {error}")),
            }
        }
    } else {
        failures.push(format!("no pose could be refined, {} was not written", out.display()));
    }
    if arguments.json {
        let document = json!({ "frames": outcomes, "failures": failures });
        say(format!("{document:#}"))?;
    }
    Ok(Outcome { done, failures })
}

struct Done {
    pose: RefinedPose,
    seconds: f64,
    report: Option<FrameReport>,
    object_warnings: Vec<String>,
    warnings: Vec<String>,
}

fn refine_job(
    assets: &mut Assets<'_>,
    job: &Job,
    config: &Config,
    with_report: bool,
) -> Result<Done, AssetError> {
    let row = &job.row;
    let object = assets.object(row.obj_id)?;
    let frame = assets.dataset().frame(row.scene_id, row.im_id)?;
    let (observation, robot) = assets.observation(&frame, job.instance, &config.terms)?;
    let start = Instant::now();
    let pose =
        refine_with(&observation, &object, robot.as_deref(), &row.t_cam_model, config, |_| true)?;
    let seconds = start.elapsed().as_secs_f64();
    let report =
        with_report.then(|| FrameReport::draw(&observation, &object, &row.t_cam_model, &pose));
    let object_warnings = inspect_object(&object);
    let warnings = inspect_pose(&observation, &object, robot.as_deref(), &row.t_cam_model);
    Ok(Done { pose, seconds, report, object_warnings, warnings })
}

fn summary(job: &Job, done: &Done) -> serde_json::Value {
    let pose = &done.pose.t_cam_object;
    let q = pose.rotation.quaternion();
    let warnings: Vec<&String> = done.object_warnings.iter().chain(&done.warnings).collect();
    json!({
        "scene_id": job.row.scene_id,
        "im_id": job.row.im_id,
        "obj_id": job.row.obj_id,
        "seconds": done.seconds,
        "iteration": done.pose.iteration,
        "iterations": done.pose.trace.iterations.len().saturating_sub(1),
        "t_cam_model_mm": (pose.translation.vector * 1e3).as_slice(),
        "quaternion_wxyz": [q.w, q.i, q.j, q.k],
        "warnings": warnings,
        "trace": done.pose.trace,
    })
}
