//! `cargo reliability`: attacks on Prehend, and a table of what came of them.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use clap::{Args, Parser, Subcommand};
use prehend_reliability::faults::{self, COMMANDS, FAULTS, Place};
use prehend_reliability::loads::{self, LOADS};
use prehend_reliability::mutate::Dice;
use prehend_reliability::parsers::PARSERS;
use prehend_reliability::table::{Row, Table};
use prehend_reliability::tools::{self, MUTANTS};
use prehend_reliability::{fuzz, seeds};

#[derive(Parser)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Give every parser broken files
    Parsers(Parsers),
    /// The same, guided by coverage, with AddressSanitizer (installs cargo-fuzz)
    Fuzz {
        /// Seconds for each parser
        #[arg(long, default_value_t = 600)]
        seconds: u64,
        #[command(flatten)]
        chosen: Chosen,
    },
    /// Kill long commands, fill the disk, break inputs, at random moments
    Faults(Faults),
    /// Carry loads: long films, many frames, large meshes, images and worlds
    Loads(Loads),
    /// Run the tests of numbers: finite ones from finite inputs, and the same ones on other instruction sets (with qemu-user)
    Numbers,
    /// Change the code here and there, and see whether a test fails (installs cargo-mutants)
    Mutants {
        /// Changes of each part of the code at least, drawn evenly
        #[arg(long, default_value_t = 100)]
        count: usize,
        /// Which of them
        #[arg(long, default_value_t = 0)]
        seed: usize,
        #[command(flatten)]
        chosen: Chosen,
    },
    /// All of it at full size, and one table in the end: takes a night
    All {
        /// The command `prehend` [default: built]
        #[arg(long)]
        program: Option<PathBuf>,
        /// Folder for the curves of memory over time
        #[arg(long)]
        curves: Option<PathBuf>,
    },
    /// Write the right files of every kind, with which corpora begin
    Seeds,
}

#[derive(Args, Default)]
struct Chosen {
    /// Of these alone; may be repeated
    #[arg(long)]
    only: Vec<String>,
}

#[derive(Args)]
struct Parsers {
    /// Seconds for each parser
    #[arg(long, default_value_t = 5)]
    seconds: u64,
    /// Seed of the changes
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    chosen: Chosen,
}

#[derive(Args)]
struct Faults {
    /// The command `prehend` [default: built]
    #[arg(long)]
    program: Option<PathBuf>,
    /// Of each fault, for each command
    #[arg(long, default_value_t = 7)]
    count: usize,
    /// Seed of the moments
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    chosen: Chosen,
}

#[derive(Args)]
struct Loads {
    /// The command `prehend` [default: built]
    #[arg(long)]
    program: Option<PathBuf>,
    /// Of their full size
    #[arg(long, default_value_t = 1.0)]
    scale: f64,
    /// Folder for the curves of memory over time
    #[arg(long)]
    curves: Option<PathBuf>,
    #[command(flatten)]
    chosen: Chosen,
}

fn main() -> Result<ExitCode> {
    let rows = match Arguments::parse().command {
        Command::Parsers(parsers) => parsers.run()?,
        Command::Fuzz { seconds, chosen } => {
            let names: Vec<&str> = chosen
                .of(PARSERS, |parser| parser.name)?
                .iter()
                .map(|parser| parser.name)
                .collect();
            tools::fuzz(seconds, &names)?
        }
        Command::Faults(faults) => faults.run()?,
        Command::Loads(loads) => loads.run()?,
        Command::Numbers => tools::numbers()?,
        Command::Mutants { count, seed, chosen } => mutants(count, seed, &chosen)?,
        Command::All { program, curves } => all(program, curves)?,
        Command::Seeds => return seeds::write().map(|()| ExitCode::SUCCESS),
    };
    println!("{}", Table(&rows));
    Ok(if rows.iter().all(Row::is_good) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Everything at the sizes of docs/RELIABILITY.md.
fn all(program: Option<PathBuf>, curves: Option<PathBuf>) -> Result<Vec<Row>> {
    let program = Some(program.map_or_else(tools::program, Ok)?);
    let fuzzed: Vec<&str> = PARSERS.iter().map(|parser| parser.name).collect();
    let chosen = Chosen::default;
    let faults = Faults { program: program.clone(), count: 7, seed: 0, chosen: chosen() };
    let parts = [
        ("parsers", Parsers { seconds: 60, seed: 0, chosen: chosen() }.run()),
        ("fuzz", tools::fuzz(600, &fuzzed)),
        ("faults", faults.run()),
        ("loads", Loads { program, scale: 1.0, curves, chosen: chosen() }.run()),
        ("numbers", tools::numbers()),
        ("mutants", mutants(100, 0, &chosen())),
    ];
    // What breaks off is a line of the table: the rest was tried all the same.
    let broken_off = |name: &str, error: anyhow::Error| {
        vec![Row { tried: 1, wrong: 1, note: format!("{error:#}"), ..Row::new(name) }]
    };
    let rows = parts.map(|(name, rows)| rows.unwrap_or_else(|error| broken_off(name, error)));
    Ok(rows.into_iter().flatten().collect())
}

impl Parsers {
    fn run(&self) -> Result<Vec<Row>> {
        let duration = Duration::from_secs(self.seconds);
        let parsers = self.chosen.of(PARSERS, |parser| parser.name)?;
        parsers.into_iter().map(|parser| told(fuzz::run(parser, self.seed, duration)?)).collect()
    }
}

impl Faults {
    fn run(self) -> Result<Vec<Row>> {
        let chosen = self.chosen.of(COMMANDS, |command| command.name)?;
        let place = Place::new(&self.program.map_or_else(tools::program, Ok)?)?;
        let mut dice = Dice::new(self.seed);
        let mut rows = Vec::new();
        for command in chosen {
            for fault in FAULTS {
                let row = faults::befall(&place, command, fault, (self.count, &mut dice))?;
                rows.extend(row.map(told).transpose()?);
            }
        }
        Ok(rows)
    }
}

impl Loads {
    fn run(self) -> Result<Vec<Row>> {
        let chosen = self.chosen.of(LOADS, |load| load.name)?;
        let program = self.program.map_or_else(tools::program, Ok)?;
        let program =
            std::fs::canonicalize(&program).with_context(|| program.display().to_string())?;
        let curves = self.curves.as_deref();
        if let Some(folder) = curves {
            std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        }
        chosen
            .into_iter()
            .map(|load| told(loads::carry(load, &program, self.scale, curves)?))
            .collect()
    }
}

fn mutants(count: usize, seed: usize, chosen: &Chosen) -> Result<Vec<Row>> {
    let parts = chosen.of(MUTANTS, |part| part.name)?;
    parts.into_iter().map(|part| told(tools::mutants(part, count, seed)?)).collect()
}

/// Says at once what came of one attack: all of them take long.
fn told(row: Row) -> Result<Row> {
    eprintln!("{}: {} of {} held {}", row.what, row.held(), row.tried, row.note);
    Ok(row)
}

impl Chosen {
    /// Those of `all` that are named, or all without names.
    fn of<'a, T>(&self, all: &'a [T], name: fn(&T) -> &str) -> Result<Vec<&'a T>> {
        if let Some(unknown) =
            self.only.iter().find(|only| !all.iter().any(|one| name(one) == **only))
        {
            bail!("{unknown} is none of {}", all.iter().map(name).collect::<Vec<_>>().join(", "));
        }
        let is_chosen =
            |one: &&T| self.only.is_empty() || self.only.iter().any(|only| only == name(one));
        Ok(all.iter().filter(is_chosen).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_options_of_all_commands_fit_together() {
        Arguments::command().debug_assert();
    }
}
