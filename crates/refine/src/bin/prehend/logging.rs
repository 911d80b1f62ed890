//! Messages of libraries and commands on standard error, by level: what has failed, what looks wrong, what is done.

use std::env;
use std::io::Write;

use anstream::ColorChoice;
use anyhow::bail;
use clap::builder::styling::{AnsiColor, Style};
use log::LevelFilter;

/// The variable that sets the level where no option does.
const VARIABLE: &str = "PREHEND_LOG";

/// Names of the levels: of each its messages and those of the levels before it are printed.
pub(crate) const LEVELS: [&str; 4] = ["error", "warn", "info", "debug"];

/// The level called `name`.
pub(crate) fn named(name: &str) -> Option<LevelFilter> {
    name.parse().ok().filter(|_| LEVELS.contains(&name.to_lowercase().as_str()))
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
pub(crate) fn set_level(level: Option<LevelFilter>) -> anyhow::Result<()> {
    let variable = || env::var(VARIABLE).ok().filter(|name| !name.is_empty());
    log::set_max_level(match (level, variable()) {
        (Some(level), _) => level,
        (None, None) => LevelFilter::Warn,
        (None, Some(found)) => match named(&found) {
            Some(level) => level,
            None => bail!("{VARIABLE}: expected error, warn, info or debug, found {found:?}"),
        },
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
