//! A progress bar with rate and remaining time; nothing when not a terminal.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A bar over `length` steps of `what`, drawn on standard error.
pub(crate) fn bar(length: u64, what: &'static str) -> ProgressBar {
    // indicatif hides a bar by itself where standard error is no terminal.
    let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr());
    let template = "{msg} [{bar:30}] {pos}/{len} {per_sec}, {eta} left";
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.set_message(what);
    bar
}
