//! Broken files by the thousand, without knowing which code they reach: what is run everywhere. `fuzz/` has the search that is guided by coverage.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

use crate::corpus;
use crate::mutate::{Dice, mutated};
use crate::parsers::Parser;
use crate::small_dataset::SmallDataset;
use crate::table::Row;

/// No file of a corpus takes nearly as long to read, on a busy machine either.
pub const HANG: Duration = Duration::from_secs(30);

/// Gives `parser` the files of its corpus, and changed ones for as long as `duration`. Those that it does not stand are kept in the temporary
/// folder, and printed. A file that is not done after three times [`HANG`] ends the program: nothing else could.
///
/// # Errors
/// If the corpus cannot be read, or a file not be kept.
pub fn run(parser: &Parser, seed: u64, duration: Duration) -> Result<Row> {
    let current = Mutex::new(None);
    let done = AtomicBool::new(false);
    thread::scope(|scope| {
        scope.spawn(|| watch(parser, &current, &done));
        let row = Trials::new(parser, &current).and_then(|trials| trials.run(seed, duration));
        done.store(true, Ordering::Relaxed);
        row
    })
}

/// The file that is read, and since when.
type Current = Mutex<Option<(Instant, Vec<u8>)>>;

fn watch(parser: &Parser, current: &Current, done: &AtomicBool) {
    while !done.load(Ordering::Relaxed) {
        let current = current.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((since, bytes)) = &*current
            && since.elapsed() > 3 * HANG
        {
            match keep(parser, bytes) {
                Ok(file) => eprintln!("{}: {} is not done", parser.name, file.display()),
                Err(error) => eprintln!("{}: not done, and not kept: {error:#}", parser.name),
            }
            std::process::abort();
        }
        drop(current);
        thread::sleep(Duration::from_millis(50));
    }
}

/// Results of the files so far.
struct Trials<'a> {
    parser: &'a Parser,
    dataset: SmallDataset,
    current: &'a Current,
    row: Row,
    /// Those that were read without complaint.
    read: usize,
}

impl<'a> Trials<'a> {
    fn new(parser: &'a Parser, current: &'a Current) -> Result<Self> {
        let row = Row::new(format!("files of `{}`", parser.name));
        Ok(Self { parser, dataset: SmallDataset::new()?, current, row, read: 0 })
    }

    fn run(mut self, seed: u64, duration: Duration) -> Result<Row> {
        let name = self.parser.name;
        let files = corpus::files(name).with_context(|| format!("the corpus of {name}"))?;
        for (_, bytes) in &files {
            self.one(bytes)?;
        }
        let mut dice = Dice::new(seed);
        let start = Instant::now();
        while start.elapsed() < duration {
            let (_, original) = &files[dice.below(files.len())];
            self.one(&mutated(original, self.parser.form, &mut dice))?;
        }
        self.row.note = format!("{} of them read", self.read);
        Ok(self.row)
    }

    fn one(&mut self, bytes: &[u8]) -> Result<()> {
        let set = |what| *self.current.lock().unwrap_or_else(PoisonError::into_inner) = what;
        let start = Instant::now();
        set(Some((start, bytes.to_vec())));
        let read = AssertUnwindSafe(|| (self.parser.read)(&self.dataset, bytes));
        let outcome = catch_unwind(read);
        set(None);
        self.row.tried += 1;
        self.read += usize::from(matches!(outcome, Ok(Ok(()))));
        let is_hang = start.elapsed() > HANG;
        if outcome.is_err() || is_hang {
            eprintln!("{}: {}", self.parser.name, keep(self.parser, bytes)?.display());
        }
        self.row.crashes += usize::from(outcome.is_err());
        self.row.hangs += usize::from(outcome.is_ok() && is_hang);
        Ok(())
    }
}

fn keep(parser: &Parser, bytes: &[u8]) -> Result<PathBuf> {
    let file = tempfile::Builder::new().prefix(parser.name).suffix(".broken").tempfile()?;
    std::fs::write(file.path(), bytes)?;
    Ok(file.keep()?.1)
}
