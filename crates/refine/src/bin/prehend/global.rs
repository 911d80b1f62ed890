//! Options of all commands.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ColorChoice};
use log::LevelFilter;

use crate::logging::{self, LEVELS};

/// What is printed.
#[derive(Args)]
#[command(next_help_heading = "All commands")]
pub(crate) struct Global {
    /// When to use colors; auto: on a terminal, unless NO_COLOR is set
    #[arg(long, global = true, value_name = "WHEN", default_value = "auto")]
    color: ColorChoice,
    /// What to print on standard error: messages of this level and above [default: PREHEND_LOG, else warn]
    #[arg(
        long,
        global = true,
        value_name = "LEVEL",
        value_parser = PossibleValuesParser::new(LEVELS).try_map(|name| logging::named(&name).ok_or("is no level")),
        conflicts_with_all = ["verbose", "quiet"]
    )]
    log_level: Option<LevelFilter>,
    /// Print more: -v is --log-level info, -vv debug
    #[arg(long, short, global = true, action = clap::ArgAction::Count, conflicts_with = "quiet")]
    verbose: u8,
    /// Print errors alone, and no progress: --log-level error
    #[arg(long, short, global = true)]
    quiet: bool,
}

impl Global {
    /// Lets messages be printed as asked for.
    pub(crate) fn apply(&self) -> anyhow::Result<()> {
        logging::set_color(self.color);
        logging::set_level(self.log_level.or(match (self.quiet, self.verbose) {
            (true, _) => Some(LevelFilter::Error),
            (false, 0) => None,
            (false, 1) => Some(LevelFilter::Info),
            (false, _) => Some(LevelFilter::Debug),
        }))
    }
}
