//! Broken files by the thousand, without knowing which code they reach: what is run everywhere. `fuzz/` has the search that is guided by coverage.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

use crate::corpus;
use crate::mutate::{Dice, mutated};
use crate::parsers::Parser;
use crate::site::Site;
use crate::table::Row;

/// No file of a corpus takes nearly as long to read, on a busy machine either.
pub const HANG: Duration = Duration::from_secs(30);

/// Gives `parser` the files of its corpus, and changed ones for as long as `duration`. Those that it does not stand are kept in the temporary
/// folder, and printed.
///
/// # Errors
/// If the corpus cannot be read, or a file not be kept.
pub fn run(parser: &Parser, seed: u64, duration: Duration) -> Result<Row> {
    let site = Site::new()?;
    let files =
        corpus::files(parser.name).with_context(|| format!("the corpus of {}", parser.name))?;
    let mut tried = Tried { row: Row::new(format!("files of `{}`", parser.name)), read: 0 };
    for (_, bytes) in &files {
        tried.one(parser, &site, bytes)?;
    }
    let mut dice = Dice::new(seed);
    let start = Instant::now();
    while start.elapsed() < duration {
        let (_, original) = &files[dice.below(files.len())];
        tried.one(parser, &site, &mutated(original, parser.form, &mut dice))?;
    }
    tried.row.note = format!("{} of them read", tried.read);
    Ok(tried.row)
}

/// What came of the files so far.
struct Tried {
    row: Row,
    /// Those that were read without complaint.
    read: usize,
}

impl Tried {
    fn one(&mut self, parser: &Parser, site: &Site, bytes: &[u8]) -> Result<()> {
        let start = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| (parser.read)(site, bytes)));
        self.row.tried += 1;
        self.read += usize::from(matches!(outcome, Ok(Ok(()))));
        let is_hang = start.elapsed() > HANG;
        if outcome.is_err() || is_hang {
            eprintln!("{}: {}", parser.name, keep(parser, bytes)?.display());
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
