//! `cargo reliability`: attacks on Prehend, and a table of what came of them.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Result, bail};
use clap::{Parser, Subcommand};
use prehend_reliability::faults::{Befallen, COMMANDS, FAULTS, Place};
use prehend_reliability::mutate::Dice;
use prehend_reliability::parsers::PARSERS;
use prehend_reliability::{fuzz, seeds};

#[derive(Parser)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Give every parser broken files
    Parsers {
        /// Seconds for each
        #[arg(long, default_value_t = 5)]
        seconds: u64,
        /// Of these parsers only
        #[arg(long)]
        only: Vec<String>,
        /// Seed of the changes
        #[arg(long, default_value_t = 0)]
        seed: u64,
    },
    /// Kill long commands, fill the disk, break inputs, at random moments
    Faults {
        /// The command `prehend`
        #[arg(long, default_value = "target/release/prehend")]
        program: PathBuf,
        /// Of each fault, for each command
        #[arg(long, default_value_t = 2)]
        count: usize,
        /// Of these commands only
        #[arg(long)]
        only: Vec<String>,
        /// Seed of the moments
        #[arg(long, default_value_t = 0)]
        seed: u64,
    },
    /// Write the right files of every kind, with which corpora begin
    Seeds,
}

fn main() -> Result<ExitCode> {
    match Arguments::parse().command {
        Command::Parsers { seconds, only, seed } => {
            parsers(Duration::from_secs(seconds), &only, seed)
        }
        Command::Faults { program, count, only, seed } => faults(&program, count, &only, seed),
        Command::Seeds => seeds::write().map(|()| ExitCode::SUCCESS),
    }
}

fn parsers(duration: Duration, only: &[String], seed: u64) -> Result<ExitCode> {
    let chosen = chosen(PARSERS, |parser| parser.name, only)?;
    let mut broken = 0;
    println!("{:<12} {:>8} {:>8} {:>8} {:>6}", "parser", "files", "read", "crashes", "hangs");
    for parser in chosen {
        let tried = fuzz::run(parser, seed, duration)?;
        let (crashes, hangs) = (&tried.crashes, &tried.hangs);
        println!(
            "{:<12} {:>8} {:>8} {:>8} {:>6}",
            parser.name,
            tried.files,
            tried.read,
            crashes.len(),
            hangs.len()
        );
        crashes.iter().chain(hangs).take(3).for_each(|file| println!("  {}", file.display()));
        broken += crashes.len() + hangs.len();
    }
    Ok(if broken == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn faults(program: &Path, count: usize, only: &[String], seed: u64) -> Result<ExitCode> {
    let chosen = chosen(COMMANDS, |command| command.name, only)?;
    let place = Place::new(program)?;
    let mut dice = Dice::new(seed);
    let mut failed = 0;
    println!("{:<12} {:<14} {:>8} {:>8}", "command", "fault", "injected", "survived");
    for command in chosen {
        for fault in FAULTS {
            let mut befallen = Befallen::default();
            befallen.add(&place, command, fault, (count, &mut dice))?;
            let survived = befallen.injected - befallen.failures.len();
            println!(
                "{:<12} {:<14} {:>8} {:>8}",
                command.name,
                format!("{fault:?}"),
                befallen.injected,
                survived
            );
            befallen.failures.iter().take(3).for_each(|failure| println!("  {failure}"));
            failed += befallen.failures.len();
        }
    }
    Ok(if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Those of `all` that are named, or all without names.
fn chosen<'a, T>(all: &'a [T], name: fn(&T) -> &str, only: &[String]) -> Result<Vec<&'a T>> {
    if let Some(unknown) = only.iter().find(|only| !all.iter().any(|one| name(one) == **only)) {
        bail!("{unknown} is none of {}", all.iter().map(name).collect::<Vec<_>>().join(", "));
    }
    let is_chosen = |one: &&T| only.is_empty() || only.iter().any(|only| only == name(one));
    Ok(all.iter().filter(is_chosen).collect())
}
