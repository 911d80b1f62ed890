//! Faults at random moments.

use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Result, ensure};

use super::place::{Files, LongCommand, Place};
use super::run::Ended;
use crate::mutate::Dice;
use crate::table::Row;

/// Faults of a run.
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

/// Draws for each fault that is to strike: a run may have ended before, or not read what is broken.
const DRAWS: usize = 8;

impl Fault {
    /// Whether it can befall `command`: not every one has inputs or threads.
    pub fn concerns(self, command: &LongCommand) -> bool {
        match self {
            Self::Threads => command.name != "export",
            Self::BrokenInput => !command.inputs.is_empty(),
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

/// Lets `fault` befall `command` until it has struck `count` times, at moments that `seed` draws; what goes wrong is printed.
///
/// # Errors
/// If the program cannot be run at all, or does not do undisturbed what it is asked.
pub fn befall(
    place: &Place,
    command: &LongCommand,
    fault: Fault,
    count: usize,
    seed: u64,
) -> Result<Row> {
    let (expected, undisturbed) = place.reference(command)?;
    let trial = Trial { place, command, expected: &expected, took: undisturbed.took };
    let mut dice = Dice::new(seed_of(seed, command, fault));
    let mut row = Row::new(format!("`{}`, {fault}", command.name));
    for _ in 0..DRAWS * count {
        if row.tried == count {
            break;
        }
        place.clear(command)?;
        match trial.run(fault, row.tried, &mut dice) {
            Ok(has_struck) => row.tried += usize::from(has_struck),
            Err(problem) => {
                eprintln!("{} {fault}: {problem:#}", command.name);
                row.tried += 1;
                match problem.downcast_ref() {
                    Some(Disorder::Hang) => row.hangs += 1,
                    Some(Disorder::Crash(_)) => row.crashes += 1,
                    None => row.wrong += 1,
                }
            }
        }
    }
    place.clear(command)?;
    if row.tried < count {
        row.note = format!("{count} were wanted");
    }
    Ok(row)
}

/// Other moments for every command and fault.
fn seed_of(seed: u64, command: &LongCommand, fault: Fault) -> u64 {
    let mut hasher = DefaultHasher::new();
    (seed, command.name, fault.to_string()).hash(&mut hasher);
    hasher.finish()
}

struct Trial<'a> {
    place: &'a Place,
    command: &'a LongCommand,
    /// Files that it writes undisturbed.
    expected: &'a Files,
    took: Duration,
}

impl Trial<'_> {
    /// The trial after `before` others: whether the fault has struck. Of kinds and numbers of threads each has its turn.
    fn run(&self, fault: Fault, before: usize, dice: &mut Dice) -> Result<bool> {
        let run = || self.place.run(self.command.words);
        let moment = self.took.mul_f64(dice.below(1000) as f64 / 1000.0);
        let has_struck = match fault {
            Fault::Killed => {
                let ended = run().interrupted(moment, |child| Ok(child.kill()?))?;
                ensure!(ended.code.is_none_or(|code| code == 0), "ended with {}", ended.error);
                ended.code.is_none()
            }
            Fault::FullDisk => {
                let longest = self.expected.values().map(Vec::len).max().unwrap_or(0);
                let ended = run().with_blocks(dice.below(longest / 512 + 2)).end()?;
                self.failed(&ended)?
            }
            Fault::BrokenInput => return self.broken_input(before, moment, dice),
            Fault::BlockedOutput => {
                let blocked = self.command.blockable;
                let output = self.place.path(blocked[dice.below(blocked.len())]);
                // Where the output is there already, or its folder is not yet, nothing is in its way.
                let ended = run().interrupted(moment, |_| {
                    let _ = fs::create_dir(&output);
                    Ok(())
                })?;
                let has_failed = self.failed(&ended)?;
                if output.is_dir() {
                    fs::remove_dir(&output)?;
                }
                has_failed
            }
            Fault::Threads => {
                let ended = run().with_threads([1, 2, 4, 8][before % 4]).end()?;
                ensure!(!self.failed(&ended)?, "{}", ended.error);
                true
            }
        };
        self.nothing_half_written()?;
        self.finished()?;
        Ok(has_struck)
    }

    /// Breaks a file while it is read.
    fn broken_input(&self, before: usize, moment: Duration, dice: &mut Dice) -> Result<bool> {
        let file = self.an_input(dice)?;
        let whole = fs::read(&file)?;
        let kind = before % 3;
        let is_removed = kind == 0;
        let ended = self.place.run(self.command.words).interrupted(moment, |_| {
            match kind {
                0 => fs::remove_file(&file)?,
                1 => fs::write(&file, &whole[..dice.below(whole.len())])?,
                _ => fs::write(&file, b"{\"0\": [\xff")?,
            }
            Ok(())
        });
        fs::write(&file, &whole)?;
        let ended = ended?;
        orderly(&ended)?;
        let written = self.place.written(self.command)?;
        let is_same = written == *self.expected;
        // Files that need not be there may be taken for absent; what is broken may not pass for right.
        let name = file.display();
        ensure!(is_same || is_removed || ended.code != Some(0), "{name}: no error, other results");
        if !is_removed {
            self.rows_are_right(&written)?;
        }
        // A journal is of a run with another input: begun anew, all is as it should be.
        self.place.clear(self.command)?;
        self.finished()?;
        Ok(ended.code != Some(0) || !is_same)
    }

    /// One of the files of the command's inputs.
    fn an_input(&self, dice: &mut Dice) -> Result<PathBuf> {
        let mut files = Vec::new();
        let mut folders: Vec<_> =
            self.command.inputs.iter().map(|name| self.place.path(name)).collect();
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder)? {
                let path = entry?.path();
                if path.is_dir() { folders.push(path) } else { files.push(path) }
            }
        }
        files.sort();
        Ok(files.swap_remove(dice.below(files.len())))
    }

    /// Whether a run failed, which it must tell; else what it wrote must be right and complete.
    fn failed(&self, ended: &Ended) -> Result<bool> {
        orderly(ended)?;
        if ended.code != Some(0) {
            ensure!(!ended.error.trim().is_empty(), "ended with {:?} and said nothing", ended.code);
            return Ok(true);
        }
        let written = self.place.written(self.command)?;
        ensure!(written == *self.expected, "ended well, with other files");
        Ok(false)
    }

    /// Checks that files which do not grow are as they will be in the end.
    fn nothing_half_written(&self) -> Result<()> {
        let is_growing =
            |path: &Path| self.command.growing.iter().any(|name| path == Path::new(name));
        let written = self.place.written(self.command)?;
        for (path, content) in written.into_iter().filter(|(path, _)| !is_growing(path)) {
            let is_right = self.expected.get(&path) == Some(&content);
            ensure!(is_right, "{} is half-written", path.display());
        }
        Ok(())
    }

    /// Tables of frames have whole rows of the right ones, if fewer.
    fn rows_are_right(&self, written: &Files) -> Result<()> {
        for table in self.command.tables.iter().map(Path::new) {
            let (Some(content), Some(expected)) = (written.get(table), self.expected.get(table))
            else {
                continue;
            };
            let rows: Vec<&[u8]> = expected.split(|byte| *byte == b'\n').collect();
            let is_known = content.split(|byte| *byte == b'\n').all(|row| rows.contains(&row));
            ensure!(is_known, "{} has a row that is not right", table.display());
        }
        Ok(())
    }

    /// Run again, it ends as if nothing had happened.
    fn finished(&self) -> Result<()> {
        let ended = self.place.run(self.command.words).end()?;
        orderly(&ended)?;
        ensure!(ended.code == Some(0), "run again: {}", ended.error);
        let written = self.place.written(self.command)?;
        for path in self.expected.keys().chain(written.keys()) {
            let is_same = self.expected.get(path) == written.get(path);
            ensure!(is_same, "{} is another in the end", path.display());
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
