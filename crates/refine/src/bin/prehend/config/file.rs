//! A file of options, as words of a command line.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io;
use std::path::PathBuf;

use clap::error::{ContextKind, ContextValue};
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command};
use prehend_geometry::limits::MAX_TEXT_BYTES;
use prehend_geometry::read_plain;
use toml::{Table, Value};

use super::words::spelled;
use super::{ConfigError, ReadError, join, options};

/// The options of a file that count for a command line.
pub(super) struct ConfigFile {
    path: PathBuf,
    /// The options as a command line has them.
    pub(super) words: Vec<OsString>,
    /// The key of each of them by the option's name.
    fields: BTreeMap<String, String>,
}

impl ConfigFile {
    /// Reads the file at `path`. Of its options those count that are of the command that is `given`, unless that has them itself, or others that
    /// exclude them.
    pub(super) fn read(
        path: PathBuf,
        command: &Command,
        given: &ArgMatches,
    ) -> Result<Self, ConfigError> {
        let text = read_plain(&path, MAX_TEXT_BYTES)
            .and_then(|bytes| String::from_utf8(bytes).map_err(io::Error::other))
            .map_err(|source| ConfigError::Read { file: path.clone(), source })?;
        let table: Table = text.parse().map_err(|error: toml::de::Error| {
            let before = error.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
            ConfigError::Syntax {
                file: path.clone(),
                line: before.matches('\n').count() + 1,
                problem: error.message().replace('\n', ", "),
            }
        })?;
        let mut file = Self { path, words: Vec::new(), fields: BTreeMap::new() };
        file.add("", &table, command, Some(given))?;
        log::debug!("{}: {:?}", file.path.display(), file.words);
        Ok(file)
    }

    /// Adds the options of the table of a command.
    fn add(
        &mut self,
        name: &str,
        table: &Table,
        command: &Command,
        given: Option<&ArgMatches>,
    ) -> Result<(), ConfigError> {
        for (key, value) in table {
            let field = join(name, key);
            if let Value::Table(inner) = value {
                let Some(inner_command) = command.find_subcommand(key) else {
                    return Err(self.fault(field, "there is no such command"));
                };
                let given = given
                    .and_then(ArgMatches::subcommand)
                    .filter(|(given, _)| *given == inner_command.get_name())
                    .map(|(_, given)| given);
                self.add(&field, inner, inner_command, given)?;
                continue;
            }
            let Some((arg, _)) = options(command).find(|(_, name)| name == key) else {
                let of = match name {
                    "" => "there is no such option of all commands".to_owned(),
                    _ => format!("there is no such option of `{}`", name.replace('.', " ")),
                };
                return Err(self.fault(field, of));
            };
            let words = spelled(arg, key, value).map_err(|e| self.fault(field.clone(), e))?;
            if given.is_some_and(|given| !is_overruled(arg, command, given)) {
                self.words.extend(words.into_iter().map(OsString::from));
                self.fields.insert(format!("--{key}"), field);
            }
        }
        Ok(())
    }

    fn fault(&self, field: String, problem: impl Into<String>) -> ConfigError {
        ConfigError::Field { file: self.path.clone(), field, problem: problem.into() }
    }

    /// The error, with the key of the file where that is at fault.
    pub(super) fn named(&self, error: clap::Error) -> ReadError {
        let options = [ContextKind::InvalidArg, ContextKind::PriorArg]
            .into_iter()
            .filter_map(|kind| match error.get(kind)? {
                ContextValue::String(option) => Some(vec![option.clone()]),
                ContextValue::Strings(options) => Some(options.clone()),
                _ => None,
            })
            .flatten();
        // clap writes `--seed <N>`.
        let field = |option: String| self.fields.get(option.split_whitespace().next()?).cloned();
        let Some(field) = options.into_iter().find_map(field) else { return error.into() };
        let message = error.to_string();
        let problem = message.split("\n\n").next().unwrap_or_default();
        self.fault(field, problem.trim_start_matches("error: ")).into()
    }
}

/// Whether the command line has the option, or one that excludes it.
fn is_overruled(arg: &Arg, command: &Command, given: &ArgMatches) -> bool {
    let excludes = |a: &Arg, b: &Arg| {
        command.get_arg_conflicts_with(a).iter().any(|other| other.get_id() == b.get_id())
    };
    command
        .get_arguments()
        .filter(|other| {
            given.value_source(other.get_id().as_str()) == Some(ValueSource::CommandLine)
        })
        .any(|other| other.get_id() == arg.get_id() || excludes(arg, other) || excludes(other, arg))
}
