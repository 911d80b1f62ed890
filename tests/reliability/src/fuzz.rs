//! Broken files by the thousand, without knowing which code they reach: what is run everywhere. `fuzz/` has the search that is guided by coverage.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

use crate::corpus;
use crate::mutate::{Dice, mutated};
use crate::parsers::Parser;
use crate::site::Site;

/// No file of a corpus takes nearly as long to read, on a busy machine either.
pub const HANG: Duration = Duration::from_secs(30);

/// What came of the files that one parser was given.
#[derive(Debug, Default)]
pub struct Tried {
    /// How many.
    pub files: usize,
    /// How many were read without complaint.
    pub read: usize,
    /// Those that ended in a panic: where they are kept.
    pub crashes: Vec<PathBuf>,
    /// Those that took longer than [`HANG`].
    pub hangs: Vec<PathBuf>,
}

/// Gives `parser` the files of its corpus, and changed ones for as long as `duration`. Those that it does not stand are kept in the temporary folder.
///
/// # Errors
/// If the corpus cannot be read, or a file not be kept.
pub fn run(parser: &Parser, seed: u64, duration: Duration) -> Result<Tried> {
    let site = Site::new()?;
    let files =
        corpus::files(parser.name).with_context(|| format!("the corpus of {}", parser.name))?;
    let mut tried = Tried::default();
    for (_, bytes) in &files {
        tried.one(parser, &site, bytes)?;
    }
    let mut dice = Dice::new(seed);
    let start = Instant::now();
    while start.elapsed() < duration {
        let (_, original) = &files[dice.below(files.len())];
        tried.one(parser, &site, &mutated(original, parser.form, &mut dice))?;
    }
    Ok(tried)
}

impl Tried {
    fn one(&mut self, parser: &Parser, site: &Site, bytes: &[u8]) -> Result<()> {
        let start = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| (parser.read)(site, bytes)));
        self.files += 1;
        self.read += usize::from(matches!(outcome, Ok(Ok(()))));
        if outcome.is_err() {
            self.crashes.push(keep(parser, bytes)?);
        } else if start.elapsed() > HANG {
            self.hangs.push(keep(parser, bytes)?);
        }
        Ok(())
    }
}

fn keep(parser: &Parser, bytes: &[u8]) -> Result<PathBuf> {
    let file = tempfile::Builder::new().prefix(parser.name).suffix(".broken").tempfile()?;
    std::fs::write(file.path(), bytes)?;
    Ok(file.keep()?.1)
}
