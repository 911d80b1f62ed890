//! Standard output and standard error.

use std::io::{ErrorKind, Write};

/// Prints `text` and a line break. That the reader has gone away (`prehend … | head`) is no error.
pub(crate) fn say(text: impl std::fmt::Display) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}

/// Prints `text` and a line break on standard error. What cannot be told there cannot be told, and is no reason to end a run.
pub(crate) fn complain(text: impl std::fmt::Display) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}
