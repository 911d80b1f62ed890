//! Messages of libraries and commands on standard error, by level: what has failed, what looks wrong, what is done.

use std::env;
use std::io::Write;

use anstream::ColorChoice;
use clap::ValueEnum;
use clap::builder::styling::{AnsiColor, Style};
use log::LevelFilter;

/// The variable that sets the level where no option does.
const VARIABLE: &str = "PREHEND_LOG";

/// What is printed: messages of a level and of those above.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub(crate) enum Level {
    Error,
    Warn,
    Info,
    Debug,
}

/// A level that is none.
#[derive(Debug, thiserror::Error)]
#[error("{VARIABLE}: expected error, warn, info or debug, found {found:?}")]
pub(crate) struct LevelError {
    found: String,
}

/// Prints what has its level as one line: `warning: …`.
struct Printer;

impl log::Log for Printer {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        // Other libraries log for their developers.
        metadata.target().starts_with("prehend")
    }

    fn log(&self, record: &log::Record<'_>) {
        if !self.enabled(record.metadata()) {
            return;
        }
        let (name, color) = match record.level() {
            log::Level::Error => ("error", AnsiColor::Red),
            log::Level::Warn => ("warning", AnsiColor::Yellow),
            log::Level::Info => ("info", AnsiColor::Green),
            log::Level::Debug | log::Level::Trace => ("debug", AnsiColor::Blue),
        };
        let style: Style = color.on_default().bold();
        // The stream drops colors where they are not wanted; a failure to print does not end the run.
        let _ = writeln!(anstream::stderr().lock(), "{style}{name}:{style:#} {}", record.args());
    }

    fn flush(&self) {}
}

/// From here on messages are printed, up to warnings.
pub(crate) fn start() {
    // Only this sets a logger, and once.
    if log::set_logger(&Printer).is_ok() {
        log::set_max_level(LevelFilter::Warn);
    }
}

/// Prints messages of `level` and above; without one, those that `PREHEND_LOG` asks for, by default warnings.
///
/// # Errors
/// If the variable names no level.
pub(crate) fn set_level(level: Option<Level>) -> Result<(), LevelError> {
    let variable = || env::var(VARIABLE).ok().filter(|name| !name.is_empty());
    let level = match (level, variable()) {
        (Some(level), _) => level,
        (None, None) => Level::Warn,
        (None, Some(found)) => Level::from_str(&found, true).map_err(|_| LevelError { found })?,
    };
    log::set_max_level(match level {
        Level::Error => LevelFilter::Error,
        Level::Warn => LevelFilter::Warn,
        Level::Info => LevelFilter::Info,
        Level::Debug => LevelFilter::Debug,
    });
    Ok(())
}

/// Whether anything but errors is to be seen.
pub(crate) fn is_quiet() -> bool {
    log::max_level() < LevelFilter::Warn
}

/// Colors on standard error: always, never, or on terminals unless `NO_COLOR` is set.
pub(crate) fn set_color(color: clap::ColorChoice) {
    match color {
        clap::ColorChoice::Auto => ColorChoice::Auto,
        clap::ColorChoice::Always => ColorChoice::Always,
        clap::ColorChoice::Never => ColorChoice::Never,
    }
    .write_global();
}
