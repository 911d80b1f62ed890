//! `prehend refine`.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use anyhow::bail;
use clap::Args;
use prehend_refine::data::bop::check_writable;
use prehend_refine::{self as refine};
use prehend_refine::{Config, StrategyKind, TermKind};

use crate::options::Selection;
use crate::outcome::Outcome;
use crate::{dataset, frame};

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
    /// How to refine, with settings that the options below change [default: fused; with --terms, combined]
    #[arg(
        long,
        value_name = "NAME",
        value_parser = named,
        long_help = method_help(),
        help_heading = "Method"
    )]
    method: Option<&'static refine::Method>,
    /// Iterations at most, fused: in each of its stages; the search ends earlier when the steps become negligible
    /// [default: up to 10 a stage; robust-icp: 60; others: 400]
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
    text + "\n\n[default: fused; with --terms, combined]"
        + "\n\nAlso fused-without-E, fused-only-E and fused-fixed-N, which `prehend study evidence` compares"
}

impl Method {
    /// The settings of the method, changed by the other options.
    pub(crate) fn config(&self) -> anyhow::Result<Config> {
        let method = self.chosen();
        let mut config = method.config();
        if let Some(terms) = &self.terms {
            if config.strategy != StrategyKind::Heuristic {
                bail!("--terms: the method {} does not combine gradients", method.name);
            }
            config.terms.clone_from(terms);
        }
        if self.no_checkpoint {
            if config.strategy == StrategyKind::Fused {
                bail!("--no-checkpoint: the method {} returns its last pose anyway", method.name);
            }
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

    /// The method asked for, or the best.
    fn chosen(&self) -> &'static refine::Method {
        // Only the heuristic takes its evidence apart by terms.
        let default =
            if self.terms.is_some() { &refine::Method::COMBINED } else { &refine::Method::FUSED };
        self.method.unwrap_or(default)
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
        (None, Some(selection), Some(poses), Some(out)) => dataset::Run {
            selection,
            poses,
            method: arguments.method.chosen().name,
            config: &arguments.method.config()?,
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
