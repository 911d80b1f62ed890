//! Faults at random moments.

use std::fs;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Result;

use super::place::{Files, LongCommand, Place};
use super::run::Ended;
use crate::mutate::Dice;
use crate::table::Row;

/// What may befall a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, strum::Display)]
pub enum Fault {
    /// It is killed, and run again.
    #[strum(serialize = "killed")]
    Killed,
    /// The disk is full at some file, and then there is room.
    #[strum(serialize = "full disk")]
    FullDisk,
    /// An input is removed, cut or overwritten while it is read, and is there again.
    #[strum(serialize = "broken input")]
    BrokenInput,
    /// A folder is in the way of an output.
    #[strum(serialize = "blocked output")]
    BlockedOutput,
    /// It runs with another number of threads.
    #[strum(serialize = "threads")]
    Threads,
}

/// All of them.
pub const FAULTS: [Fault; 5] =
    [Fault::Killed, Fault::FullDisk, Fault::BrokenInput, Fault::BlockedOutput, Fault::Threads];

impl Fault {
    /// Whether it can befall `command`: not every one has inputs or threads.
    pub fn concerns(self, command: &LongCommand) -> bool {
        match self {
            Self::Threads => command.name != "export",
            Self::BrokenInput => command.name != "synth",
            _ => true,
        }
    }
}

/// How a run that is not as it should be ended, other than with wrong files.
#[derive(Debug, thiserror::Error)]
enum Disorder {
    #[error("did not end")]
    Hang,
    #[error("{0}")]
    Crash(String),
}

/// Lets `fault` befall `command` `count` times, drawn by `dice`; what goes wrong is printed.
///
/// # Errors
/// If the program cannot be run at all, or does not do undisturbed what it is asked.
pub fn befall(
    place: &Place,
    command: &LongCommand,
    fault: Fault,
    (count, dice): (usize, &mut Dice),
) -> Result<Row> {
    let (expected, undisturbed) = place.reference(command)?;
    let mut row = Row::new(format!("`{}`, {fault}", command.name));
    for _ in 0..count {
        place.clear(command)?;
        row.tried += 1;
        let trial = Trial { place, command, expected: &expected, took: undisturbed.took };
        if let Err(problem) = trial.run(fault, dice) {
            eprintln!("{} {fault}: {problem:#}", command.name);
            match problem.downcast_ref() {
                Some(Disorder::Hang) => row.hangs += 1,
                Some(Disorder::Crash(_)) => row.crashes += 1,
                None => row.wrong += 1,
            }
        }
    }
    place.clear(command)?;
    Ok(row)
}

struct Trial<'a> {
    place: &'a Place,
    command: &'a LongCommand,
    /// What it writes undisturbed.
    expected: &'a Files,
    took: Duration,
}

impl Trial<'_> {
    fn run(&self, fault: Fault, dice: &mut Dice) -> Result<()> {
        let run = || self.place.run(self.command.words);
        let moment = self.took.mul_f64(dice.below(1000) as f64 / 1000.0);
        match fault {
            Fault::Killed => drop(run().interrupted(moment, |child| Ok(child.kill()?))?),
            Fault::FullDisk => {
                let longest = self.expected.values().map(Vec::len).max().unwrap_or(0);
                let ended = run().with_blocks(dice.below(longest / 512 + 2)).end()?;
                orderly(&ended)?;
            }
            Fault::BrokenInput => {
                let file = self.an_input(dice)?;
                let whole = fs::read(&file)?;
                let ended = run().interrupted(moment, |_| {
                    match dice.below(3) {
                        0 => fs::remove_file(&file)?,
                        1 => fs::write(&file, &whole[..dice.below(whole.len())])?,
                        _ => fs::write(&file, b"{\"0\": [\xff")?,
                    }
                    Ok(())
                });
                fs::write(&file, &whole)?;
                orderly(&ended?)?;
                // Results may be of fewer frames, or of what the file said; and journals of a run with another input.
                return self.place.clear(self.command).and_then(|()| self.finished());
            }
            Fault::BlockedOutput => {
                let output =
                    self.place.path(self.command.outputs[dice.below(self.command.outputs.len())]);
                let made = |_: &mut std::process::Child| {
                    // Where the output is there already, or is a folder, nothing is in its way.
                    let _ = fs::create_dir(&output);
                    Ok(())
                };
                orderly(&run().interrupted(moment, made)?)?;
                if fs::read_dir(&output).is_ok_and(|mut inside| inside.next().is_none()) {
                    fs::remove_dir(&output)?;
                }
            }
            Fault::Threads => {
                let ended = run().with_threads([1, 2, 4, 8][dice.below(4)]).end()?;
                orderly(&ended)?;
            }
        }
        self.nothing_half_written()?;
        self.finished()
    }

    /// One of the files that the dataset is made of.
    fn an_input(&self, dice: &mut Dice) -> Result<PathBuf> {
        let mut files = Vec::new();
        let mut folders = vec![self.place.path("ds")];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder)? {
                let path = entry?.path();
                if path.is_dir() { folders.push(path) } else { files.push(path) }
            }
        }
        files.sort();
        Ok(files.swap_remove(dice.below(files.len())))
    }

    /// What can be seen is as it will be in the end.
    fn nothing_half_written(&self) -> Result<()> {
        for (path, content) in self.place.written(self.command)? {
            let is_right = self.expected.get(&path) == Some(&content);
            anyhow::ensure!(is_right, "{} is half-written", path.display());
        }
        Ok(())
    }

    /// Run again, it ends as if nothing had happened.
    fn finished(&self) -> Result<()> {
        let ended = self.place.run(self.command.words).end()?;
        orderly(&ended)?;
        anyhow::ensure!(ended.code == Some(0), "run again: {}", ended.error);
        let written = self.place.written(self.command)?;
        for path in self.expected.keys().chain(written.keys()) {
            let is_same = self.expected.get(path) == written.get(path);
            anyhow::ensure!(is_same, "{} is another in the end", path.display());
        }
        Ok(())
    }
}

/// It ended by itself, in time, and told its faults in its own words.
fn orderly(ended: &Ended) -> Result<(), Disorder> {
    if ended.hung {
        return Err(Disorder::Hang);
    }
    if ended.error.contains("panicked") || !matches!(ended.code, Some(0..=2)) {
        return Err(Disorder::Crash(format!("ended with {:?}: {}", ended.code, ended.error)));
    }
    Ok(())
}
