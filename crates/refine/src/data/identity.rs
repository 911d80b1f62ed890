//! The settings and inputs that determine the results of a run, as facts to be compared.

use std::collections::BTreeSet;
use std::fs;
use std::hash::{DefaultHasher, Hasher};
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::data::bop::{Dataset, DatasetError, present, read_bytes};

/// Facts by name. Two runs with equal facts have equal results.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Identity(Map<String, Value>);

impl Identity {
    /// The fields of a structure, or of a JSON object, as facts; and the version of this program.
    pub fn of(facts: &impl Serialize) -> Self {
        let mut map = match serde_json::to_value(facts) {
            Ok(Value::Object(map)) => map,
            Ok(other) => Map::from_iter([("value".to_owned(), other)]),
            Err(error) => Map::from_iter([("error".to_owned(), error.to_string().into())]),
        };
        map.insert("program".into(), program().into());
        Self(map)
    }

    /// One line for every fact in which `other` differs, as `name: ours | theirs`.
    pub(crate) fn differences(&self, other: &Self) -> Vec<String> {
        let names: BTreeSet<&String> = self.0.keys().chain(other.0.keys()).collect();
        names
            .into_iter()
            .filter(|name| self.0.get(*name) != other.0.get(*name))
            .map(|name| {
                let text = |map: &Map<String, Value>| match map.get(name) {
                    None => "absent".to_owned(),
                    Some(Value::String(text)) => text.clone(),
                    Some(value) => value.to_string(),
                };
                let (ours, theirs) = excerpts(&text(&self.0), &text(&other.0));
                format!("{name}: {ours} | {theirs}")
            })
            .collect()
    }
}

/// Where two texts differ first, with some of what is before and after.
fn excerpts(a: &str, b: &str) -> (String, String) {
    const BEFORE: usize = 30;
    const LENGTH: usize = 60;
    let common = a.chars().zip(b.chars()).take_while(|(a, b)| a == b).count();
    let excerpt = |text: &str| -> String {
        let skipped = if text.chars().count() > LENGTH { common.saturating_sub(BEFORE) } else { 0 };
        text.chars().skip(skipped).take(LENGTH).collect()
    };
    (excerpt(a), excerpt(b))
}

/// The version of this program, and a fingerprint of the very build.
pub(crate) fn program() -> String {
    let build = std::env::current_exe().and_then(fs::read).map(|bytes| fingerprint(&bytes));
    let build = build.unwrap_or_else(|_| "unknown".into());
    format!("{} {build}", env!("CARGO_PKG_VERSION"))
}

/// A fingerprint of some bytes against accidental change, 64 bits; the same for one build of this program.
pub(crate) fn fingerprint(bytes: &[u8]) -> String {
    let mut hasher = DefaultHasher::new();
    hasher.write(bytes);
    format!("{:016x}", hasher.finish())
}

/// The fingerprint of a file.
///
/// # Errors
/// If it cannot be read.
pub fn file_fingerprint(file: &Path) -> Result<String, DatasetError> {
    read_bytes(file).map(|bytes| fingerprint(&bytes))
}

/// JSON files of a scene that estimators read.
pub const SENSED: [&str; 3] = ["scene_camera.json", "scene_bodies.json", "scene_tactile.json"];

/// A fingerprint of the files of all scenes that are called as one of `names`, such as [`SENSED`], and of the models'
/// `models_info.json`; not of pictures and meshes, which are many.
///
/// # Errors
/// If a file is there and cannot be read.
pub fn dataset_fingerprint(dataset: &Dataset, names: &[&str]) -> Result<String, DatasetError> {
    let scenes = dataset.scenes().flat_map(|s| names.iter().map(|name| s.dir().join(name)));
    let models = dataset.models().dir().join("models_info.json");
    let mut hasher = DefaultHasher::new();
    for file in scenes.chain([models]) {
        let name = file.strip_prefix(dataset.root()).unwrap_or(&file);
        hasher.write(name.to_string_lossy().as_bytes());
        hasher.write(present(read_bytes(&file))?.as_deref().unwrap_or(b"absent"));
    }
    Ok(format!("{:016x}", hasher.finish()))
}

/// The folder of a dataset in the one way of writing it, where the system knows it.
pub fn canonical(path: &Path) -> String {
    fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf()).display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn differences_are_named_and_long_texts_cut_to_where_they_differ() {
        let long = |sigma: &str| format!("Config {{ {} sigma: {sigma}, tail }}", "x".repeat(200));
        let one = Identity::of(&json!({ "seed": 1, "only": true, "config": long("0.5") }));
        let other = Identity::of(&json!({ "seed": 2, "config": long("inf") }));
        let said = one.differences(&other);
        assert_eq!(said.len(), 3, "{said:?}");
        assert!(said[0].contains("sigma: 0.5") && said[0].contains("sigma: inf"), "{}", said[0]);
        assert!(said[0].len() < 150);
        assert_eq!(said[1..], ["only: true | absent", "seed: 1 | 2"]);
        assert_eq!(one.differences(&one), [""; 0]);
    }
}
