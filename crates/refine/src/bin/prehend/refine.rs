//! `prehend refine`.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use anyhow::bail;
use clap::Args;
use prehend_refine::bop::check_writable;
use prehend_refine::{Config, TermKind};

use crate::options::Input;
use crate::outcome::Outcome;
use crate::{dataset, frame};

#[derive(Args)]
#[command(
    override_usage = "prehend refine --dataset <DIR> --poses <FILE> --out <FILE> [OPTIONS]\n       \
                            prehend refine --frame <FILE> [OPTIONS]"
)]
#[command(mut_arg("dataset", |a| a.required(false).required_unless_present("frame")))]
#[command(mut_arg("poses", |a| a.required(false).required_unless_present("frame")))]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: Option<Input>,
    /// Instead of a dataset, one frame described by a JSON file (see docs/FRAME.md)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["Input", "report"], help_heading = "Input")]
    frame: Option<PathBuf>,
    /// Write the refined poses here: a BOP results file, or JSON with --frame (then optional)
    ///
    /// The file appears whole or not at all, once all frames are done; an existing one is replaced. Until then
    /// FILE.journal records the finished frames: after an interruption the same command resumes, and ends with
    /// the same file. What frames took is in FILE.times.csv.
    #[arg(long, value_name = "FILE", required_unless_present = "frame", help_heading = "Output")]
    out: Option<PathBuf>,
    /// Write a web page here, with pictures of the poses before and after and loss curves
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    report: Option<PathBuf>,
    /// Print JSON on standard output: poses, times, loss curves and failures
    #[arg(long, help_heading = "Output")]
    json: bool,
    /// Put times into the results' last column, which is -1 otherwise; frames are then refined one after another, each
    /// with all threads
    #[arg(long, conflicts_with = "frame", help_heading = "Output")]
    time: bool,
    /// Discard what an interrupted run with other settings left, instead of refusing
    #[arg(long, conflicts_with = "frame", help_heading = "Output")]
    restart: bool,
    #[command(flatten)]
    method: Method,
    /// Worker threads; the poses are the same for any number [default: all cores]
    #[arg(long, value_name = "N", help_heading = "Method")]
    threads: Option<NonZeroUsize>,
}

/// How to refine.
#[derive(Args)]
pub(crate) struct Method {
    /// How evidence moves the pose: `heuristic` weighs one step along each term's gradient by its success
    #[arg(
        long,
        value_name = "NAME",
        default_value = "heuristic",
        value_parser = ["heuristic"],
        hide_possible_values = true,
        help_heading = "Method"
    )]
    strategy: String,
    /// Iterations at most; the search ends earlier when the steps become negligible
    #[arg(long, value_name = "N", default_value_t = 400, help_heading = "Method")]
    iterations: usize,
    /// Run all the iterations, however small the steps become
    #[arg(long, help_heading = "Method")]
    exhaustive: bool,
    /// Evidence to use, a list of physics, rendering, depth and tactile such as "rendering,depth"
    /// [default: all; with --frame, what the frame brings]
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Method")]
    terms: Option<Vec<TermKind>>,
    /// Return the last pose instead of the one whose rendering fits best
    #[arg(long, help_heading = "Method")]
    no_checkpoint: bool,
    /// Seed of the points sampled on the object's surface
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Method")]
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
    // What cannot be written must be known before the work, not after it.
    if let Some(out) = &arguments.out {
        check_writable(out)?;
    }
    if let Some(threads) = arguments.threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads.get()).build_global()?;
    }
    match (&arguments.frame, &arguments.input, &arguments.out) {
        (Some(file), ..) => {
            frame::run(file, &arguments.method, arguments.out.as_deref(), arguments.json)
        }
        (None, Some(input), Some(out)) => dataset::Run {
            input,
            method: &arguments.method.strategy,
            config: &arguments.method.config(),
            seed: arguments.method.seed,
            threads: arguments.threads,
            out,
            report: arguments.report.as_deref(),
            json: arguments.json,
            time: arguments.time,
            restart: arguments.restart,
        }
        .run(),
        _ => bail!("give --dataset, --poses and --out, or --frame"),
    }
}
