//! The command line, completed by a file of options.

mod error;
mod file;
mod print;
mod words;

use std::ffi::{OsStr, OsString};
use std::path::PathBuf;

use clap::error::ErrorKind;
use clap::{Arg, ArgMatches, ColorChoice, Command};

pub(crate) use self::error::{ConfigError, ReadError};
use self::file::ConfigFile;

/// What a command line asks for.
pub(crate) enum Asked {
    /// To run a command with these options.
    Run(ArgMatches),
    /// To print this text.
    Print(String),
}

/// Reads the command line `words`, the first of which is the program, and the file of options that it names.
///
/// # Errors
/// What clap finds wrong, with the file and its key where it is the file's; and if the file cannot be read, has options that there
/// are not, or values that no option takes.
pub(crate) fn read(command: &Command, mut words: Vec<OsString>) -> Result<Asked, ReadError> {
    let given = partial(command, &words);
    let path = given.as_ref().and_then(|given| given.get_one::<PathBuf>("config").cloned());
    let mut file = None;
    if let (Some(path), Some(given)) = (path, &given) {
        let read = ConfigFile::read(path, command, given)?;
        insert(&mut words, &read.words);
        file = Some(read);
    }
    let partial = partial(command, &words);
    let color = partial.as_ref().and_then(|all| all.get_one::<ColorChoice>("color").copied());
    let colored = command.clone().color(color.unwrap_or(ColorChoice::Auto));
    match (colored.try_get_matches_from(words), partial) {
        (Ok(all), _) if all.get_flag("print_config") => {
            Ok(Asked::Print(print::text(command, &all)?))
        }
        (Ok(all), _) => Ok(Asked::Run(all)),
        // What is to be filled in may be missing.
        (Err(error), Some(all))
            if error.kind() == ErrorKind::MissingRequiredArgument
                && all.get_flag("print_config") =>
        {
            Ok(Asked::Print(print::text(command, &all)?))
        }
        (Err(error), _) => Err(match file {
            Some(file) => file.named(error),
            None => error.into(),
        }),
    }
}

/// What the words say as far as they can be read, whatever is wrong or missing.
fn partial(command: &Command, words: &[OsString]) -> Option<ArgMatches> {
    // Help would end it.
    let command = command.clone().ignore_errors(true).disable_help_flag(true);
    command
        .disable_version_flag(true)
        .disable_help_subcommand(true)
        .try_get_matches_from(words)
        .ok()
}

/// Adds options at the end of a command line, or before what follows `--`.
fn insert(words: &mut Vec<OsString>, options: &[OsString]) {
    let end = words.iter().position(|word| word == OsStr::new("--")).unwrap_or(words.len());
    words.splice(end..end, options.iter().cloned());
}

/// The options of a command that a file may have.
fn options(command: &Command) -> impl Iterator<Item = (&Arg, &str)> {
    let option = |arg| Arg::get_long(arg).map(|name| (arg, name));
    let once = ["config", "print-config", "help", "version"];
    command.get_arguments().filter_map(option).filter(move |(_, name)| !once.contains(name))
}

/// Whether an option takes a list.
fn takes_list(arg: &Arg) -> bool {
    matches!(arg.get_action(), clap::ArgAction::Append)
        || arg.get_num_args().is_some_and(|range| range.max_values() > 1)
}

/// The path of a key in a file.
fn join(table: &str, key: &str) -> String {
    if table.is_empty() { key.into() } else { format!("{table}.{key}") }
}
