//! Failures of a run, and its exit code.

use std::fmt::Display;
use std::path::Path;
use std::process::ExitCode;

use serde::Serialize;

use crate::terminal::complain;

/// Failures of frames, of rows that could not be read and of files that could not be written, one line each.
#[derive(Default, Serialize)]
#[serde(transparent)]
pub(crate) struct Failures(Vec<String>);

impl Failures {
    /// The value of `result`; an error is added to the failures, after the name of what has failed.
    pub(crate) fn keep<T>(
        &mut self,
        name: impl Display,
        result: Result<T, impl Display>,
    ) -> Option<T> {
        result.map_err(|error| self.add(format!("{name}: {error}"))).ok()
    }

    /// Adds what is wrong with rows of a file.
    pub(crate) fn add_rows(&mut self, file: &Path, errors: &[String]) {
        self.0.extend(errors.iter().map(|error| format!("{}: {error}", file.display())));
    }

    /// Adds all of `others`.
    pub(crate) fn extend(&mut self, others: Self) {
        self.0.extend(others.0);
    }

    /// Adds one that no error tells of.
    pub(crate) fn add(&mut self, failure: impl Into<String>) {
        self.0.push(failure.into());
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The exit code of a run of which `done` frames succeeded: 0 without failures, 2 if some frames failed and 1 if all did. The failures are printed to
    /// standard error.
    pub(crate) fn exit_code(&self, done: usize) -> ExitCode {
        if self.0.is_empty() {
            return ExitCode::SUCCESS;
        }
        complain(format!("\n{done} done, {} failed:", self.0.len()));
        self.0.iter().for_each(|failure| complain(format!("  {failure}")));
        ExitCode::from(if done > 0 { 2 } else { 1 })
    }
}
