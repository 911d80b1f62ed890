//! Values of a file, as words of a command line.

use clap::{Arg, ArgAction};
use toml::Value;

use super::takes_list;

/// The words of a command line that give `value` to the option `name`.
pub(super) fn spelled(arg: &Arg, name: &str, value: &Value) -> Result<Vec<String>, &'static str> {
    let words = |texts: Vec<String>| -> Vec<String> {
        // Given or not, a default is the same, but for options that exclude this one.
        if arg
            .get_default_values()
            .iter()
            .map(|text| text.to_str())
            .eq(texts.iter().map(|text| Some(text.as_str())))
        {
            return Vec::new();
        }
        texts.iter().map(|text| format!("--{name}={text}")).collect()
    };
    match (arg.get_action(), value) {
        (ArgAction::SetTrue, Value::Boolean(set)) => Ok(vec![format!("--{name}"); (*set).into()]),
        (ArgAction::SetTrue, _) => Err("must be true or false"),
        (ArgAction::Count, Value::Integer(times @ 0..=255)) => {
            Ok(vec![format!("--{name}"); *times as usize])
        }
        (ArgAction::Count, _) => Err("must be a count"),
        (_, Value::Array(list)) if takes_list(arg) => {
            let texts = list.iter().map(text).collect::<Result<Vec<_>, _>>()?;
            Ok(words(texts))
        }
        (_, Value::Array(_)) => Err("takes one value, not a list"),
        _ => Ok(words(vec![text(value)?])),
    }
}

fn text(value: &Value) -> Result<String, &'static str> {
    match value {
        Value::String(text) => Ok(text.clone()),
        Value::Integer(number) => Ok(number.to_string()),
        Value::Float(number) => Ok(number.to_string()),
        _ => Err("must be text or a number"),
    }
}
