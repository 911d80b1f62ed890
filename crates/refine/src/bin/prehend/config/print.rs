//! Options in effect, as a file of them.

use clap::{Arg, ArgAction, ArgMatches, Command};
use toml::Value;

use super::{ConfigError, join, options, takes_list};

/// The options of all commands and of the command asked for.
pub(super) fn text(command: &Command, given: &ArgMatches) -> Result<String, ConfigError> {
    let mut text = String::new();
    let (mut name, mut command, mut given) = (String::new(), command, given);
    loop {
        let lines = options(command)
            .map(|(arg, option)| line(arg, option, given))
            .collect::<Result<Vec<_>, _>>()?;
        if !lines.is_empty() {
            if !name.is_empty() {
                text += &format!("\n[{name}]\n");
            }
            text += &lines.concat();
        }
        let Some((inner, matches)) = given.subcommand() else { return Ok(text) };
        let Some(inner_command) = command.find_subcommand(inner) else { return Ok(text) };
        (name, command, given) = (join(&name, inner), inner_command, matches);
    }
}

/// The line of an option; a comment where it has no value.
fn line(arg: &Arg, option: &str, given: &ArgMatches) -> Result<String, ConfigError> {
    let id = arg.get_id().as_str();
    let value = match arg.get_action() {
        ArgAction::SetTrue => Some(Value::Boolean(given.get_flag(id))),
        ArgAction::Count => Some(Value::Integer(given.get_count(id).into())),
        _ => {
            let raw = given.get_raw(id).unwrap_or_default();
            let mut values = Vec::new();
            for text in raw {
                let text =
                    text.to_str().ok_or_else(|| ConfigError::Text { option: option.into() })?;
                values.push(scalar(text));
            }
            match values {
                values if values.is_empty() => None,
                values if takes_list(arg) => Some(Value::Array(values)),
                values => values.into_iter().next(),
            }
        }
    };
    Ok(match value {
        Some(value) => format!("{option} = {value}\n"),
        None => {
            let names = arg.get_value_names().unwrap_or_default();
            let names: Vec<&str> = names.iter().map(|name| name.as_str()).collect();
            format!("# {option} = {}\n", names.join(", "))
        }
    })
}

/// A number where its text would be the same again.
fn scalar(text: &str) -> Value {
    let integer = text.parse().ok().filter(|number: &i64| number.to_string() == text);
    let float = text.parse().ok().filter(|number: &f64| number.to_string() == text);
    match (integer, float.filter(|number| number.is_finite())) {
        (Some(number), _) => Value::Integer(number),
        (None, Some(number)) => Value::Float(number),
        (None, None) => Value::String(text.into()),
    }
}
