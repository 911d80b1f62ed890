//! `prehend refine`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, bail};
use clap::Args;
use prehend_refine::bop::{ResultRow, write_atomically, write_results};
use prehend_refine::report::{FrameReport, Report};
use prehend_refine::{AssetError, Assets, Config, RefinedPose, TermKind, refine_with};
use serde_json::json;

use crate::options::{Filter, Input, Job, label};
use crate::outcome::Outcome;
use crate::{frame, progress};

#[derive(Args)]
pub(crate) struct Arguments {
    /// BOP dataset: the folder that holds models/ and test/.
    #[arg(long, value_name = "DIR", requires = "poses", required_unless_present = "frame")]
    dataset: Option<PathBuf>,
    /// Initial poses, as a BOP results file.
    #[arg(long, value_name = "FILE", requires = "dataset")]
    poses: Option<PathBuf>,
    /// One frame, described by a JSON file (see docs/FRAME.md), instead of a dataset.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["dataset", "poses", "report"])]
    frame: Option<PathBuf>,
    /// Split to use, if the dataset has several.
    #[arg(long, value_name = "NAME")]
    split: Option<String>,
    /// Where to write the refined poses (BOP results file; JSON for --frame). It appears whole or not at all.
    #[arg(long, value_name = "FILE", required_unless_present = "frame")]
    out: Option<PathBuf>,
    #[command(flatten)]
    filter: Filter,
    #[command(flatten)]
    method: Method,
    /// Worker threads; the poses are the same for any number. [default: all cores]
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Write pictures before and after, loss curves and an index.html here.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Also print the outcome as JSON on standard output.
    #[arg(long)]
    json: bool,
}

/// How to refine.
#[derive(Args)]
pub(crate) struct Method {
    /// How candidate steps become a pose: the paper's heuristic.
    #[arg(long, value_name = "NAME", default_value = "heuristic", value_parser = ["heuristic"])]
    strategy: String,
    /// Iterations at most; it ends earlier when nothing improves.
    #[arg(long, value_name = "N", default_value_t = 400)]
    iterations: usize,
    /// Run all the iterations even after nothing improves.
    #[arg(long)]
    exhaustive: bool,
    /// Evidence to use, of physics, rendering, depth and tactile. [default: all; with --frame, all that
    /// the frame brings]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    terms: Option<Vec<TermKind>>,
    /// Return the last pose instead of the one whose rendering fits best.
    #[arg(long)]
    no_checkpoint: bool,
    /// Seed of the surface samples.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
}

impl Method {
    pub(crate) fn config(&self) -> Config {
        let mut config = Config::default();
        if let Some(terms) = &self.terms {
            config.terms.clone_from(terms);
        }
        config.checkpoint = !self.no_checkpoint;
        config.heuristic.iterations = self.iterations;
        config.heuristic.exhaustive = self.exhaustive;
        config
    }

    pub(crate) fn seed(&self) -> u64 {
        self.seed
    }

    pub(crate) fn terms_given(&self) -> bool {
        self.terms.is_some()
    }
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    if let Some(threads) = arguments.threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    }
    if let Some(file) = &arguments.frame {
        return frame::run(file, &arguments.method, arguments.out.as_deref());
    }
    let (Some(dataset), Some(poses), Some(out)) =
        (&arguments.dataset, &arguments.poses, &arguments.out)
    else {
        bail!("give --dataset, --poses and --out, or --frame");
    };
    let input = Input {
        dataset: dataset.clone(),
        split: arguments.split.clone(),
        poses: poses.clone(),
        filter: Filter {
            scene: arguments.filter.scene.clone(),
            image: arguments.filter.image.clone(),
            object: arguments.filter.object.clone(),
        },
    };
    dataset_run(arguments, &input, out)
}

fn dataset_run(arguments: &Arguments, input: &Input, out: &Path) -> anyhow::Result<Outcome> {
    let dataset = input.open()?;
    let (jobs, mut failures) = input.jobs()?;
    let method = &arguments.method;
    let config = method.config();
    let mut assets = Assets::new(&dataset, method.seed());
    let mut report = arguments.report.as_deref().map(Report::create).transpose()?;
    let mut rows = Vec::new();
    let mut outcomes = Vec::new();
    let bar = progress::bar(jobs.len() as u64, "refining");
    for job in &jobs {
        match refine_job(&mut assets, job, &config, report.is_some()) {
            Ok(done) => {
                outcomes.push(summary(job, &done));
                if let (Some(report), Some(frame)) = (&mut report, &done.report) {
                    report.add(&label(&job.row), frame).context("writing the report")?;
                }
                rows.push(ResultRow {
                    t_cam_model: done.pose.t_cam_object,
                    time: done.seconds,
                    ..job.row.clone()
                });
            }
            Err(error) => failures.push(format!("{}: {error:#}", label(&job.row))),
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    share_time(&mut rows);
    write_results(out, &rows)?;
    if let Some(report) = report {
        report.finish().context("writing the report")?;
    }
    if arguments.json {
        let document = json!({ "frames": outcomes, "failures": failures });
        println!("{}", serde_json::to_string_pretty(&document)?);
    } else {
        let seconds: f64 = outcomes.iter().filter_map(|o| o["seconds"].as_f64()).sum();
        let mean = seconds / rows.len().max(1) as f64;
        println!("{} poses refined in {mean:.2} s each, written to {}", rows.len(), out.display());
    }
    Ok(Outcome { done: rows.len(), failures })
}

struct Done {
    pose: RefinedPose,
    seconds: f64,
    report: Option<FrameReport>,
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
    Ok(Done { pose, seconds, report })
}

fn summary(job: &Job, done: &Done) -> serde_json::Value {
    let pose = &done.pose.t_cam_object;
    let q = pose.rotation.quaternion();
    json!({
        "scene_id": job.row.scene_id,
        "im_id": job.row.im_id,
        "obj_id": job.row.obj_id,
        "seconds": done.seconds,
        "iteration": done.pose.iteration,
        "iterations": done.pose.trace.iterations.len().saturating_sub(1),
        "t_cam_model_mm": (pose.translation.vector * 1e3).as_slice(),
        "quaternion_wxyz": [q.w, q.i, q.j, q.k],
        "trace": done.pose.trace,
    })
}

/// BOP wants the time of the whole image on each of its rows.
fn share_time(rows: &mut [ResultRow]) {
    let times: Vec<f64> = rows
        .iter()
        .map(|r| {
            let same = rows.iter().filter(|o| (o.scene_id, o.im_id) == (r.scene_id, r.im_id));
            same.map(|o| o.time).sum()
        })
        .collect();
    rows.iter_mut().zip(times).for_each(|(row, time)| row.time = time);
}

/// Writes `document` to `out`, or prints it.
pub(crate) fn deliver(document: &serde_json::Value, out: Option<&Path>) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(document)? + "\n";
    match out {
        Some(file) => write_atomically(file, text.as_bytes())?,
        None => print!("{text}"),
    }
    Ok(())
}
