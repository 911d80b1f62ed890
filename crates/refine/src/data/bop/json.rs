//! JSON files keyed by image or object id, read such that a fault names its file and field.
//!
//! Entries are converted one by one: a fault in the entry of one image leaves the others usable. That includes `NaN` and
//! `Infinity`, which other writers emit and JSON does not know.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::UnitQuaternion;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::entries::Entries;
use super::error::DatasetError;
use super::files::read_bytes;
use super::pose::{
    deviation_from_rotation, exactly, require_in_range, rotation_from_row_major, rotations_off,
};
use super::unique::parse_json;

/// A JSON file whose top level is an object; it is read once, when something of it is first asked for.
#[derive(Debug)]
pub(super) struct JsonFile {
    path: PathBuf,
    root: OnceLock<Result<Entries, DatasetError>>,
    /// A warning of rotations that are not quite orthonormal was given.
    is_told: AtomicBool,
}

impl JsonFile {
    pub(super) fn new(path: PathBuf) -> Self {
        Self { path, root: OnceLock::new(), is_told: AtomicBool::new(false) }
    }

    /// The same with `text` in place of what is in the file.
    pub(super) fn with_text(path: PathBuf, text: &str) -> Self {
        let file = Self::new(path);
        let entries = Entries::new(text.as_bytes());
        // Nothing else has read it yet.
        let _ =
            file.root.set(entries.map_err(|problem| DatasetError::unusable(&file.path, problem)));
        file
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the file is there, readable or not.
    pub(super) fn exists(&self) -> bool {
        self.path.exists()
    }

    /// The fields of the top-level object.
    ///
    /// # Errors
    /// When the file is absent, cannot be read, is not JSON, or its top level is no object.
    pub(super) fn root(&self) -> Result<&Entries, DatasetError> {
        let read = || {
            let text = read_bytes(&self.path)?;
            Entries::new(&text).map_err(|problem| DatasetError::unusable(&self.path, problem))
        };
        self.root.get_or_init(read).as_ref().map_err(Clone::clone)
    }

    /// All of the file.
    ///
    /// # Errors
    /// When it is absent or broken, or not of the type.
    pub(super) fn whole<T: DeserializeOwned>(&self) -> Result<T, DatasetError> {
        read_json(&self.path)
    }

    fn value(&self, name: &str) -> Result<Option<Value>, DatasetError> {
        let fault = |problem: String| DatasetError::field(&self.path, name, problem);
        self.root()?.get(name).transpose().map_err(fault)
    }

    /// A field of the top level, if it is there.
    ///
    /// # Errors
    /// Those of [`JsonFile::root`], and [`DatasetError::Field`] if it is not of its type.
    pub(super) fn field<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>, DatasetError> {
        let value = self.value(name)?;
        value.map(|value| convert(&self.path, name.to_owned(), &value)).transpose()
    }

    /// The entry of an image or object id.
    ///
    /// # Errors
    /// Those of [`JsonFile::root`], [`DatasetError::NoEntry`], and [`DatasetError::Field`] for the first field that is
    /// absent or not of its type.
    pub(super) fn entry<T: DeserializeOwned>(&self, id: u32) -> Result<T, DatasetError> {
        let (key, value) = self.entry_value(id)?;
        convert(&self.path, key, &value)
    }

    /// The key and the value of an image or object id.
    fn entry_value(&self, id: u32) -> Result<(String, Value), DatasetError> {
        let key = id.to_string();
        match self.value(&key)? {
            Some(value) => Ok((key, value)),
            None => Err(DatasetError::NoEntry { file: self.path.clone(), key }),
        }
    }
}

impl JsonFile {
    /// The entries of an image that has one or a list of them, each with what it is called.
    ///
    /// # Errors
    /// Those of [`JsonFile::entry`].
    pub(super) fn entries<T: DeserializeOwned>(
        &self,
        id: u32,
    ) -> Result<Vec<(String, T)>, DatasetError> {
        let one = |name: String, value| Ok((name.clone(), convert(&self.path, name, &value)?));
        match self.entry_value(id)? {
            (key, Value::Array(all)) => {
                let named = all.into_iter().enumerate();
                named.map(|(k, value)| one(format!("{key}[{k}]"), value)).collect()
            }
            (key, value) => Ok(vec![one(key, value)?]),
        }
    }

    /// Warns, once a file, of rotations that are not quite orthonormal.
    pub(super) fn check_rotations<'r>(&self, rotations: impl Iterator<Item = &'r Rotation>) {
        let largest = rotations.filter_map(|rotation| rotation.1).reduce(f64::max);
        if let Some(deviation) = largest.filter(|_| !self.is_told.swap(true, Ordering::Relaxed)) {
            log::warn!("{}", rotations_off(&self.path, deviation));
        }
    }

    /// See [`field_fault`].
    pub(super) fn fault(&self, field: &str, problem: &str) -> DatasetError {
        field_fault(&self.path, field, problem)
    }
}

/// An error about a field, where `problem` may be that a part of it is missing.
pub(crate) fn field_fault(file: &Path, field: &str, problem: &str) -> DatasetError {
    let (absent, problem) = plain(problem);
    let absent = absent.map(|name| format!(".{name}")).unwrap_or_default();
    DatasetError::field(file, &format!("{field}{absent}"), problem)
}

/// What a file of one layout says.
///
/// # Errors
/// When the file is absent, cannot be read or is not JSON, and [`DatasetError::Field`] for the first field that is absent or
/// not of its type.
pub(crate) fn read_json<T: DeserializeOwned>(file: &Path) -> Result<T, DatasetError> {
    convert(file, String::new(), &read_value(file)?)
}

/// The same of a file in which every number is within range.
///
/// # Errors
/// Those of [`read_json`], and [`DatasetError::Field`] for the first number that is not.
pub(crate) fn read_json_in_range<T: DeserializeOwned>(file: &Path) -> Result<T, DatasetError> {
    let value = read_value(file)?;
    check_range(&value, String::new())
        .map_err(|(field, problem)| DatasetError::field(file, &field, problem))?;
    convert(file, String::new(), &value)
}

fn read_value(file: &Path) -> Result<Value, DatasetError> {
    parse_json(&read_bytes(file)?).map_err(|e| DatasetError::unusable(file, e))
}

/// Finds a number that is out of range, in what is called `name`: its own name, and what is wrong with it.
fn check_range(value: &Value, name: String) -> Result<(), (String, String)> {
    match value {
        Value::Number(number) => {
            let checked = require_in_range(number.as_f64().unwrap_or(f64::INFINITY));
            checked.map(|_| ()).map_err(|problem| (name, problem))
        }
        Value::Array(list) => {
            let mut named = list.iter().enumerate();
            named.try_for_each(|(k, inner)| check_range(inner, format!("{name}[{k}]")))
        }
        Value::Object(map) => map.iter().try_for_each(|(key, inner)| {
            let dot = if name.is_empty() { "" } else { "." };
            check_range(inner, format!("{name}{dot}{key}"))
        }),
        Value::Null | Value::Bool(_) | Value::String(_) => Ok(()),
    }
}

/// A part of a file, which is called `field` there.
fn convert<T: DeserializeOwned>(
    file: &Path,
    mut field: String,
    value: &Value,
) -> Result<T, DatasetError> {
    serde_path_to_error::deserialize(value).map_err(|error| {
        let (path, problem) = (error.path().to_string(), error.inner().to_string());
        let (absent, problem) = plain(&problem);
        for name in [path.as_str()].into_iter().filter(|path| *path != ".").chain(absent) {
            field += if field.is_empty() || name.starts_with('[') { "" } else { "." };
            field += name;
        }
        match field.as_str() {
            "" => DatasetError::unusable(file, problem),
            field => DatasetError::field(file, field, problem),
        }
    })
}

/// What serde says of a value, in words that name no Rust type; first the name of the field if it is absent.
fn plain(problem: &str) -> (Option<&str>, String) {
    if let Some(name) = problem.strip_prefix("missing field `").and_then(|p| p.split('`').next()) {
        return (Some(name), "is missing".into());
    }
    let Some((found, expected)) =
        problem.split_once(", expected ").filter(|(found, _)| found.starts_with("invalid "))
    else {
        return (None, problem.into());
    };
    let kind = match expected {
        "f64" => "a finite number",
        "u32" => "an id",
        "a sequence" => "a list",
        "a map" => "an object",
        _ if expected.starts_with("struct") => "an object",
        other => other,
    };
    let absent = found == "invalid type: null";
    (None, if absent { "is missing".into() } else { format!("is not {kind}") })
}

/// `N` numbers; a matrix may also be a list of rows.
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "Vec<NumberOrRow>")]
pub(crate) struct Numbers<const N: usize>(pub(crate) [f64; N]);

#[derive(Deserialize)]
#[serde(untagged, expecting = "is not a finite number")]
enum NumberOrRow {
    Number(f64),
    Row(Vec<f64>),
}

impl<const N: usize> TryFrom<Vec<NumberOrRow>> for Numbers<N> {
    type Error = String;

    fn try_from(list: Vec<NumberOrRow>) -> Result<Self, String> {
        let flat = list.into_iter().flat_map(|entry| match entry {
            NumberOrRow::Number(value) => vec![value],
            NumberOrRow::Row(values) => values,
        });
        let flat: Vec<f64> = flat.map(require_in_range).collect::<Result<_, _>>()?;
        exactly(flat).map(Self)
    }
}

/// A number within range.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "f64")]
pub(crate) struct Real(pub(crate) f64);

impl TryFrom<f64> for Real {
    type Error = String;

    fn try_from(value: f64) -> Result<Self, String> {
        require_in_range(value).map(Self)
    }
}

/// A number above zero.
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "f64")]
pub(crate) struct Positive(pub(crate) f64);

impl TryFrom<f64> for Positive {
    type Error = String;

    fn try_from(value: f64) -> Result<Self, String> {
        match require_in_range(value)? {
            value if value > 0.0 => Ok(Self(value)),
            _ => Err("must be above zero".into()),
        }
    }
}

/// A rotation of nine row-major entries.
#[derive(Deserialize)]
#[serde(try_from = "Numbers<9>")]
pub(crate) struct Rotation(
    pub(crate) UnitQuaternion<f64>,
    /// How far the matrix was from orthonormal, where that was more than rounding.
    pub(crate) Option<f64>,
);

impl TryFrom<Numbers<9>> for Rotation {
    type Error = String;

    fn try_from(numbers: Numbers<9>) -> Result<Self, String> {
        let rotation = rotation_from_row_major(&numbers.0)?;
        Ok(Self(rotation, deviation_from_rotation(&numbers.0)))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn file(text: &str) -> JsonFile {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scene.json");
        std::fs::write(&path, text).unwrap();
        let file = JsonFile::new(path);
        let _ = file.root();
        file
    }

    /// What is wrong with entry `id` as a `T`.
    fn fault<T: DeserializeOwned>(file: &JsonFile, id: u32) -> String {
        match file.entry::<T>(id).map(|_| ()).unwrap_err() {
            DatasetError::Field { field, problem, .. } => format!("{field}: {problem}"),
            other => other.to_string(),
        }
    }

    #[test]
    fn a_fault_names_its_field() {
        #[derive(Deserialize)]
        struct A {
            #[expect(dead_code)]
            a: Vec<B>,
        }
        #[derive(Deserialize)]
        struct B {
            #[expect(dead_code)]
            b: Numbers<3>,
        }
        type Of<T> = BTreeMap<String, T>;
        let f = file(
            r#"{"3": {"a": [{"b": [1, 2]}]}, "4": {}, "5": {"s": 1}, "6": {"n": "x"}, "7": {"i": -1}}"#,
        );
        assert_eq!(fault::<A>(&f, 3), "3.a[0].b: expected 3 numbers, found 2");
        assert_eq!(fault::<A>(&f, 4), "4.a: is missing");
        assert_eq!(fault::<Of<String>>(&f, 5), "5.s: is not a string");
        assert_eq!(fault::<Of<f64>>(&f, 6), "6.n: is not a finite number");
        assert_eq!(fault::<Of<u32>>(&f, 7), "7.i: is not an id");
        assert_eq!(fault::<Of<Positive>>(&f, 7), "7.i: must be above zero");
        assert_eq!(fault::<Of<Vec<f64>>>(&f, 6), "6.n: is not a list");
        assert_eq!(fault::<Of<Numbers<3>>>(&f, 5), "5.s: is not a list");
        assert_eq!(fault::<Of<Of<f64>>>(&f, 6), "6.n: is not an object");
        assert_eq!(fault::<Of<A>>(&f, 6), "6.n: is not an object");
        let absent = f.entry::<A>(8).map(|_| ()).unwrap_err();
        assert!(matches!(absent, DatasetError::NoEntry { key, .. } if key == "8"));
    }

    #[test]
    fn nan_spoils_only_its_own_field() {
        #[derive(Debug, Deserialize, PartialEq)]
        struct Named {
            name: String,
        }
        #[derive(Deserialize)]
        struct Placed {
            t: Numbers<3>,
            scale: Option<Positive>,
        }
        let f = file(
            r#"{"0": {"t": [1, NaN, -Infinity], "name": "a NaN \" in a string"}, "1": {"t": [1, 2, 3]},
                "2": {"t": [1, 2, 3], "scale": null}, "3": {"t": [1, 2, 3], "scale": NaN}}"#,
        );
        assert_eq!(fault::<Placed>(&f, 0), "0.t[1]: is not a finite number");
        assert_eq!(f.entry(0), Ok(Named { name: "a NaN \" in a string".into() }));
        assert_eq!(f.entry::<Placed>(1).map(|p| p.t.0), Ok([1.0, 2.0, 3.0]));
        // Nor does it count as the absence of an optional field.
        assert!(f.entry::<Placed>(2).unwrap().scale.is_none());
        assert_eq!(fault::<Placed>(&f, 3), "3.scale: is not a finite number");
    }
}
