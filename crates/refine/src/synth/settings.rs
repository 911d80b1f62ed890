//! Settings as TOML: presets, and numbers by name.

use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

/// Settings of these files, each over those before it.
pub(super) fn preset<T: DeserializeOwned>(files: &[&str]) -> T {
    let mut all = Table::new();
    files.iter().flat_map(|file| file.parse()).for_each(|changes| merge(&mut all, changes));
    // Files of these folders, which tests read.
    all.try_into().unwrap_or_else(|error| unreachable!("a preset is broken: {error}"))
}

/// Puts the values of `changes` in place of those that `settings` have.
pub(super) fn merge(settings: &mut Table, changes: Table) {
    for (name, change) in changes {
        match (settings.get_mut(&name), change) {
            (Some(Value::Table(known)), Value::Table(change)) => merge(known, change),
            (_, change) => drop(settings.insert(name, change)),
        }
    }
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
