//! `prehend eval`.

use std::process::ExitCode;

use clap::Args;
use prehend_refine::evaluate::Scorer;
use prehend_refine::evaluate::metrics::summarize;
use serde_json::json;

use crate::options::Input;
use crate::terminal::{exit_code, progress, say};

#[derive(Args)]
pub(crate) struct Eval {
    #[command(flatten)]
    input: Input,
    /// Print JSON, with the score of every pose, instead of tables
    #[arg(long, help_heading = "Output")]
    json: bool,
}

impl Eval {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let Input { selection, poses } = &self.input;
        let dataset = selection.open()?;
        let (jobs, mut failures) = selection.jobs(poses)?;
        let mut scorer = Scorer::new(&dataset);
        let mut rows = Vec::new();
        for job in progress(jobs.len(), "scoring").wrap_iter(jobs.iter()) {
            match scorer.score(&job.row) {
                Ok(row) => rows.push(row),
                Err(error) => failures.push(format!("{}: {error}", job.target)),
            }
        }
        let summary = summarize(&rows);
        if self.json {
            let document = json!({ "poses": rows, "summary": summary, "failures": failures });
            say(format!("{document:#}"))?;
        } else if !rows.is_empty() {
            say(summary.text(|id| format!("object {id}")))?;
        }
        Ok(exit_code(rows.len(), &failures))
    }
}
