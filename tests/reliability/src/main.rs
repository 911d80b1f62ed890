//! `cargo reliability`: attacks on Prehend, and a table of what came of them.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use clap::{Args, Parser, Subcommand};
use prehend_reliability::attack::{Attack, resume, run_all};
use prehend_reliability::faults::{self, COMMANDS, FAULTS, Fault, LongCommand, Place};
use prehend_reliability::loads::{self, LOADS, Load};
use prehend_reliability::mutants::{self, MUTANTS, Mutated};
use prehend_reliability::parsers::{PARSERS, Parser as FileParser};
use prehend_reliability::table::{Row, Table};
use prehend_reliability::{fuzz, seeds, tools};

#[derive(Parser)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Give every parser broken files
    Parsers(Parsers),
    /// Give every parser files of a coverage-guided fuzzer, with AddressSanitizer (installs cargo-fuzz)
    Fuzz(Fuzz),
    /// Kill long commands, fill the disk, break inputs, at random moments
    Faults(Faults),
    /// Carry loads: long films, many frames, large meshes, images and models
    Loads(Loads),
    /// Run the tests of numbers: finite ones from finite inputs, and the same ones on other instruction sets (with qemu-user)
    Numbers,
    /// Change the code here and there, and see whether a test fails (installs cargo-mutants)
    Mutants(Mutants),
    /// All of it at full size, and one table in the end: takes a night; one that is cut short goes on where it was
    All(All),
    /// Write the right files of every kind, with which corpora begin
    Seeds,
}

#[derive(Args)]
struct Chosen {
    /// Name of one to run instead of all; may be repeated
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
struct Fuzz {
    /// Seconds for each parser
    #[arg(long, default_value_t = 600)]
    seconds: u64,
    #[command(flatten)]
    chosen: Chosen,
}

#[derive(Args)]
struct Faults {
    /// The command `prehend` [default: built]
    #[arg(long)]
    program: Option<PathBuf>,
    /// How often each fault has to strike each command
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
    /// Factor of the loads' full size
    #[arg(long, default_value_t = 1.0)]
    scale: f64,
    /// Folder for the curves of memory over time
    #[arg(long)]
    curves: Option<PathBuf>,
    #[command(flatten)]
    chosen: Chosen,
}

#[derive(Args)]
struct Mutants {
    /// Changes of each part of the code at least, drawn evenly
    #[arg(long, default_value_t = 100)]
    count: usize,
    /// Which of them
    #[arg(long, default_value_t = 0)]
    seed: usize,
    #[command(flatten)]
    chosen: Chosen,
}

#[derive(Args)]
struct All {
    /// The command `prehend` [default: built]
    #[arg(long)]
    program: Option<PathBuf>,
    /// Folder for the curves of memory over time
    #[arg(long)]
    curves: Option<PathBuf>,
    /// Where the rows of the table are kept [default: target/reliability.json]
    #[arg(long)]
    rows: Option<PathBuf>,
    /// Try again what that has good rows of
    #[arg(long)]
    restart: bool,
}

fn main() -> Result<ExitCode> {
    let rows = match Arguments::parse().command {
        Command::Parsers(parsers) => run_all(parsers.attacks()?),
        Command::Fuzz(fuzz) => run_all(fuzz.attacks()?),
        Command::Faults(faults) => run_all(faults.attacks(&faults.place()?)?),
        Command::Loads(loads) => run_all(loads.attacks()?),
        Command::Numbers => run_all(tools::numbers()),
        Command::Mutants(mutants) => run_all(mutants.attacks()?),
        Command::All(all) => all.run()?,
        Command::Seeds => return seeds::write().map(|()| ExitCode::SUCCESS),
    };
    println!("{}", Table(&rows));
    Ok(if rows.iter().all(Row::is_good) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

impl Parsers {
    fn attacks(&self) -> Result<Vec<Attack<'_>>> {
        let duration = Duration::from_secs(self.seconds);
        let attack = |parser: &'static FileParser| {
            let name = format!("files of `{}`", parser.name);
            Attack::new(name, move || fuzz::run(parser, self.seed, duration))
        };
        Ok(self.chosen.of(PARSERS, |parser| parser.name)?.into_iter().map(attack).collect())
    }
}

impl Fuzz {
    fn attacks(&self) -> Result<Vec<Attack<'_>>> {
        let attack = |parser: &'static FileParser| {
            let name = format!("files of `{}`, by coverage", parser.name);
            Attack::new(name, || tools::fuzz(parser.name, self.seconds))
        };
        Ok(self.chosen.of(PARSERS, |parser| parser.name)?.into_iter().map(attack).collect())
    }
}

impl Faults {
    fn place(&self) -> Result<Place> {
        Place::new(program(self.program.as_deref())?)
    }

    fn attacks<'a>(&'a self, place: &'a Place) -> Result<Vec<Attack<'a>>> {
        let commands = self.chosen.of(COMMANDS, |command| command.name)?;
        let all = commands.into_iter().flat_map(|command| FAULTS.map(|fault| (command, fault)));
        let attack = |(command, fault): (&'static LongCommand, Fault)| {
            Attack::new(format!("`{}`, {fault}", command.name), move || {
                faults::befall(place, command, fault, self.count, self.seed)
            })
        };
        Ok(all.filter(|(command, fault)| fault.concerns(command)).map(attack).collect())
    }
}

impl Loads {
    fn attacks(&self) -> Result<Vec<Attack<'_>>> {
        let program = program(self.program.as_deref())?;
        if let Some(folder) = &self.curves {
            std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        }
        let attack = |load: &'static Load| {
            let program = program.clone();
            let curves = self.curves.as_deref();
            Attack::new(load.what, move || loads::run(load, &program, self.scale, curves))
        };
        Ok(self.chosen.of(LOADS, |load| load.name)?.into_iter().map(attack).collect())
    }
}

impl Mutants {
    fn attacks(&self) -> Result<Vec<Attack<'_>>> {
        let attack = |part: &'static Mutated| {
            let name = format!("mutants of {}", part.name);
            Attack::new(name, move || mutants::run(part, self.count, self.seed))
        };
        Ok(self.chosen.of(MUTANTS, |part| part.name)?.into_iter().map(attack).collect())
    }
}

impl All {
    /// Everything at full size.
    fn run(self) -> Result<Vec<Row>> {
        let program = Some(program(self.program.as_deref())?);
        let parsers = Parsers { seconds: 60, ..defaults()? };
        let fuzz: Fuzz = defaults()?;
        let faults = Faults { program: program.clone(), ..defaults()? };
        let place = faults.place()?;
        let loads = Loads { program, curves: self.curves, ..defaults()? };
        let mutants: Mutants = defaults()?;
        let attacks = [
            parsers.attacks()?,
            fuzz.attacks()?,
            faults.attacks(&place)?,
            loads.attacks()?,
            tools::numbers(),
            mutants.attacks()?,
        ];
        let file = self.rows.unwrap_or_else(|| tools::root().join("target/reliability.json"));
        resume(attacks.into_iter().flatten().collect(), &file, self.restart)
    }
}

/// Default options of a command.
fn defaults<T: Args>() -> Result<T> {
    let command = T::augment_args(clap::Command::new("defaults"));
    Ok(T::from_arg_matches(&command.try_get_matches_from(["defaults"])?)?)
}

/// The command `prehend` that is meant, whatever folder it is run in.
fn program(given: Option<&Path>) -> Result<PathBuf> {
    let program = given.map_or_else(tools::program, |path| Ok(path.to_owned()))?;
    std::fs::canonicalize(&program).with_context(|| program.display().to_string())
}

impl Chosen {
    /// Those of `all` that are named, or all without names.
    fn of<T>(&self, all: &'static [T], name: fn(&T) -> &str) -> Result<Vec<&'static T>> {
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

    #[test]
    fn defaults_are_those_of_the_command_line() {
        let Ok(Arguments { command: Command::Faults(given) }) =
            Arguments::try_parse_from(["reliability", "faults"])
        else {
            panic!("no command");
        };
        let faults: Faults = defaults().unwrap();
        assert_eq!((faults.count, faults.seed), (given.count, given.seed));
    }
}
