//! `prehend eval`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use prehend_refine::data::bop::{Dataset, ResultRow};
use prehend_refine::evaluate::Scorer;
use prehend_refine::evaluate::localization::{seconds_per_image, summarize_localization};
use prehend_refine::evaluate::metrics::summarize;
use serde_json::json;

use crate::failures::Failures;
use crate::options::{InputArgs, Job};
use crate::terminal::{progress, say};

#[derive(Args)]
pub(crate) struct Eval {
    #[command(flatten)]
    input: InputArgs,
    /// Print BOP's average recall over all targets instead: AR_VSD, AR_MSSD, AR_MSPD and AR, by object too
    ///
    /// Of each object in an image, as many poses count as there are instances to be found, those of the highest scores; what has no
    /// pose counts as missed. Needs models_info.json, and depth/ for AR_VSD and AR; without it AR_MSSD and AR_MSPD are printed. The time is the mean of the file's last column over images.
    #[arg(long)]
    bop: bool,
    /// What is to be found, as BOP's test_targets_bop19.json has it
    /// [default: that file of the dataset, or all objects of which a tenth is visible]
    #[arg(long, value_name = "FILE", requires = "bop", help_heading = "Input")]
    targets: Option<PathBuf>,
    /// Print JSON instead of tables, with the score of every pose unless --bop is given
    #[arg(long, help_heading = "Output")]
    json: bool,
}

impl Eval {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let InputArgs { selection, poses } = &self.input;
        let dataset = selection.open()?;
        let (jobs, failures) = selection.jobs(poses, None)?;
        if self.bop {
            let rows: Vec<ResultRow> = jobs.into_iter().map(|job| job.row).collect();
            self.localization(&dataset, &rows, &failures)
        } else {
            self.metrics(&dataset, &jobs, failures)
        }
    }

    /// Means and medians of all metrics over the poses.
    fn metrics(
        &self,
        dataset: &Dataset,
        jobs: &[Job],
        mut failures: Failures,
    ) -> anyhow::Result<ExitCode> {
        let mut scorer = Scorer::new(dataset);
        let mut rows = Vec::new();
        for job in progress(jobs.len(), "scoring").wrap_iter(jobs.iter()) {
            rows.extend(failures.keep(job.target, scorer.score(&job.row)));
        }
        let summary = summarize(&rows);
        if self.json {
            let document = json!({ "poses": rows, "summary": summary, "failures": failures });
            say(format!("{document:#}"))?;
        } else if !rows.is_empty() {
            say(summary.text(|id| format!("object {id}")))?;
        }
        Ok(failures.exit_code(rows.len()))
    }

    /// BOP's average recall over the targets. A fault of the dataset ends it, as recall is of all targets; that of a row is
    /// told, and its target missed.
    fn localization(
        &self,
        dataset: &Dataset,
        rows: &[ResultRow],
        failures: &Failures,
    ) -> anyhow::Result<ExitCode> {
        let InputArgs { selection, poses } = &self.input;
        let mut scorer = Scorer::new(dataset);
        let mut targets = scorer.targets(self.targets.as_deref())?;
        targets.retain(|t| selection.admits(t.scene_id, t.im_id, t.obj_id));
        if targets.is_empty() {
            bail!("no target is of the scenes, images and objects asked for");
        }
        let seconds = seconds_per_image(poses, rows)?;
        let mut scores = Vec::new();
        for target in progress(targets.len(), "scoring").wrap_iter(targets.iter()) {
            scores.push(scorer.localize(target, rows)?);
        }
        let summary = summarize_localization(&scores);
        if self.json {
            let document =
                json!({ "bop": summary, "seconds_per_image": seconds, "failures": failures });
            say(format!("{document:#}"))?;
        } else {
            let time = seconds.map_or_else(|| "unknown".into(), |s| format!("{s:.3} s"));
            let table = summary.table(|id| format!("object {id}"));
            say(format!("{table}\ntime per image: {time}"))?;
        }
        Ok(failures.exit_code(rows.len()))
    }
}
