//! `prehend eval`.

use clap::Args;
use prehend_refine::evaluate::Scorer;
use prehend_refine::evaluate::metrics::summarize;
use serde_json::json;

use crate::options::{Input, label};
use crate::outcome::Outcome;
use crate::output::say;
use crate::progress;

#[derive(Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: Input,
    /// Print JSON, with the score of every pose, instead of tables
    #[arg(long, help_heading = "Output")]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let dataset = arguments.input.open()?;
    let (jobs, mut failures) = arguments.input.jobs()?;
    let mut scorer = Scorer::new(&dataset);
    let mut rows = Vec::new();
    let bar = progress::bar(jobs.len() as u64, "scoring");
    for job in &jobs {
        match scorer.score(&job.row) {
            Ok(row) => rows.push(row),
            Err(error) => failures.push(format!("{}: {error}", label(&job.row))),
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    let summary = summarize(&rows);
    if arguments.json {
        let document = json!({ "poses": rows, "summary": summary, "failures": failures });
        say(format!("{document:#}"))?;
    } else if !rows.is_empty() {
        say(summary.text(|id| format!("object {id}")))?;
    }
    Ok(Outcome { done: rows.len(), failures })
}
