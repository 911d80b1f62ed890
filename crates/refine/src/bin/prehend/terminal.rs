//! Standard output, standard error and progress; and where preparations are kept between runs.

use std::io::{ErrorKind, IsTerminal, Write};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use prehend_geometry::GridCache;
use prehend_refine::data::user_cache;

use crate::logging;

/// Where preparations are kept between runs; grids that are built are told of on a terminal.
pub(crate) fn cache() -> Option<GridCache> {
    let is_seen = std::io::stderr().is_terminal() && !logging::is_quiet();
    user_cache().map(|cache| if is_seen { cache.telling(|text| complain(text)) } else { cache })
}

/// Prints `text` and a line break. That the reader has gone away (`prehend … | head`) is no error.
pub(crate) fn say(text: impl std::fmt::Display) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}

/// Prints `text` and a line break on standard error; a failure to do so does not end the run.
pub(crate) fn complain(text: impl std::fmt::Display) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

/// Prints a warning about something of this name over the progress bar.
pub(crate) fn warn(
    bar: &ProgressBar,
    name: impl std::fmt::Display,
    warning: impl std::fmt::Display,
) {
    bar.suspend(|| log::warn!("{name}: {warning}"));
}

/// A progress bar over `length` steps of `what` with rate and remaining time, on standard error; hidden where that is no
/// terminal or only errors are to be seen, and gone when it is dropped.
pub(crate) fn progress(length: usize, what: &'static str) -> ProgressBar {
    // indicatif hides a bar by itself where standard error is no terminal.
    let target = if logging::is_quiet() {
        ProgressDrawTarget::hidden()
    } else {
        ProgressDrawTarget::stderr()
    };
    let bar = ProgressBar::with_draw_target(Some(length as u64), target);
    let template = "{msg} [{bar:30}] {pos}/{len} {per_sec}, {eta} left";
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.set_message(what);
    bar
}
