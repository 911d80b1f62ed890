//! Settings as TOML: presets, and numbers by name.

use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

use crate::settings::merge;

/// Settings of these files, each over those before it.
pub(super) fn preset<T: DeserializeOwned>(files: &[&str]) -> T {
    let mut all = Value::from(Table::new());
    let changes = files.iter().flat_map(|file| file.parse::<Table>());
    changes.for_each(|changes| merge(&mut all, changes.into()));
    // Files of these folders, which tests read.
    all.try_into().unwrap_or_else(|error| unreachable!("a preset is broken: {error}"))
}

/// Numbers of `settings`, each with its name, such as `depth.noise`.
pub(super) fn numbers(settings: &impl Serialize) -> Vec<(String, f64)> {
    let all = Table::try_from(settings).unwrap_or_default();
    let mut found = Vec::new();
    for (name, value) in all {
        match value {
            Value::Table(group) => {
                found.extend(numbers(&group).into_iter().map(|(n, v)| (format!("{name}.{n}"), v)));
            }
            Value::Float(number) => found.push((name, number)),
            Value::Integer(number) => found.push((name, number as f64)),
            _ => {}
        }
    }
    found
}
