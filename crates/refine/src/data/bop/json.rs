//! JSON files keyed by image or object id, read so that a fault names its file and field.
//!
//! Entries are looked at one by one: a fault in one image's entry leaves the others usable. That
//! includes the `NaN` and `Infinity` that other writers emit and JSON does not know.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use nalgebra::{Isometry3, Vector3};
use serde_json::{Map, Value};

use super::error::DatasetError;
use super::pose::{rotation_from_row_major, translation_from_mm};

/// A JSON file whose top level is an object.
#[derive(Clone, Debug)]
pub struct JsonFile {
    path: PathBuf,
    root: Map<String, Value>,
}

impl JsonFile {
    /// Reads a file.
    ///
    /// # Errors
    /// When it is absent, cannot be read, is not JSON, or its top level is no object.
    pub fn read(path: &Path) -> Result<Self, DatasetError> {
        let bytes = fs::read(path).map_err(|e| DatasetError::reading(path, &e))?;
        let parsed = serde_json::from_slice(&bytes).or_else(|error| {
            // Report the strict parser's complaint unless non-finite numbers were all that stopped it.
            serde_json::from_slice(&false_for_non_finite(&bytes)).map_err(|_| error)
        });
        match parsed {
            Ok(Value::Object(root)) => Ok(Self { path: path.to_path_buf(), root }),
            Ok(_) => Err(DatasetError::malformed(path, "the top level is not a JSON object")),
            Err(e) => Err(DatasetError::malformed(path, format!("not valid JSON: {e}"))),
        }
    }

    /// The file it was read from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The top-level keys, in alphabetical order.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.root.keys().map(String::as_str)
    }

    /// The top-level entry of an image or object id.
    ///
    /// # Errors
    /// [`DatasetError::NoEntry`].
    pub fn entry(&self, id: u32) -> Result<Entry<'_>, DatasetError> {
        let key = id.to_string();
        match self.root.get(&key) {
            Some(value) => Ok(Entry { file: &self.path, field: key, value }),
            None => Err(DatasetError::NoEntry { file: self.path.clone(), key }),
        }
    }
}

/// Replaces `NaN`, `Infinity` and `-Infinity` outside strings by `false`, which no field accepts: unlike `null`,
/// it does not count as absent.
fn false_for_non_finite(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len());
    let (mut i, mut in_string) = (0, false);
    while let Some(&byte) = bytes.get(i) {
        let word = [&b"NaN"[..], b"-Infinity", b"Infinity"]
            .into_iter()
            .find(|w| bytes[i..].starts_with(w));
        match (in_string, byte, word) {
            (true, b'\\', _) => {
                out.extend(bytes[i..].iter().take(2));
                i += 2;
            }
            (false, _, Some(word)) => {
                out.extend(b"false");
                i += word.len();
            }
            _ => {
                in_string ^= byte == b'"';
                out.push(byte);
                i += 1;
            }
        }
    }
    out
}

/// A JSON file that is read when it is first asked for, once.
#[derive(Debug)]
pub(crate) struct LazyJson {
    path: PathBuf,
    content: OnceLock<Result<JsonFile, DatasetError>>,
}

impl LazyJson {
    pub(crate) fn new(path: PathBuf) -> Self {
        Self { path, content: OnceLock::new() }
    }

    pub(crate) fn get(&self) -> Result<&JsonFile, DatasetError> {
        self.content.get_or_init(|| JsonFile::read(&self.path)).as_ref().map_err(Clone::clone)
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the file is there, readable or not.
    pub(crate) fn exists(&self) -> bool {
        self.path.exists()
    }
}

/// A value inside a JSON file that knows where it stands.
#[derive(Clone, Debug)]
pub struct Entry<'a> {
    file: &'a Path,
    field: String,
    value: &'a Value,
}

impl<'a> Entry<'a> {
    /// A [`DatasetError::Field`] about this value.
    pub fn error(&self, problem: impl ToString) -> DatasetError {
        DatasetError::Field {
            file: self.file.to_path_buf(),
            field: self.field.clone(),
            problem: problem.to_string(),
        }
    }

    /// The member `name`, or `None` if absent or null.
    ///
    /// # Errors
    /// When this value is no object.
    pub fn find(&self, name: &str) -> Result<Option<Entry<'a>>, DatasetError> {
        let members = self.value.as_object().ok_or_else(|| self.error("is not an object"))?;
        Ok(members.get(name).filter(|v| !v.is_null()).map(|value| self.member(name, value)))
    }

    /// The member `name`.
    ///
    /// # Errors
    /// When this value is no object or lacks the member.
    pub fn get(&self, name: &str) -> Result<Entry<'a>, DatasetError> {
        static ABSENT: Value = Value::Null;
        self.find(name)?.ok_or_else(|| self.member(name, &ABSENT).error("is missing"))
    }

    /// All members with their names, in alphabetical order.
    ///
    /// # Errors
    /// When this value is no object.
    pub fn members(&self) -> Result<Vec<(&'a str, Entry<'a>)>, DatasetError> {
        let members = self.value.as_object().ok_or_else(|| self.error("is not an object"))?;
        Ok(members.iter().map(|(name, value)| (name.as_str(), self.member(name, value))).collect())
    }

    /// The elements of a list.
    ///
    /// # Errors
    /// When this value is no list.
    pub fn items(&self) -> Result<Vec<Entry<'a>>, DatasetError> {
        let items = self.value.as_array().ok_or_else(|| self.error("is not a list"))?;
        let at =
            |(i, value)| Entry { file: self.file, field: format!("{}[{i}]", self.field), value };
        Ok(items.iter().enumerate().map(at).collect())
    }

    /// A finite number.
    ///
    /// # Errors
    /// When this value is none.
    pub fn number(&self) -> Result<f64, DatasetError> {
        self.value
            .as_f64()
            .filter(|v| v.is_finite())
            .ok_or_else(|| self.error("is not a finite number"))
    }

    /// A number above zero.
    ///
    /// # Errors
    /// When this value is none.
    pub fn positive(&self) -> Result<f64, DatasetError> {
        self.number()
            .and_then(|v| if v > 0.0 { Ok(v) } else { Err(self.error("must be above zero")) })
    }

    /// An id: a whole number from 0.
    ///
    /// # Errors
    /// When this value is none.
    pub fn id(&self) -> Result<u32, DatasetError> {
        let id = self.value.as_u64().and_then(|v| u32::try_from(v).ok());
        id.ok_or_else(|| self.error("is not an id"))
    }

    /// A string.
    ///
    /// # Errors
    /// When this value is none.
    pub fn text(&self) -> Result<&'a str, DatasetError> {
        self.value.as_str().ok_or_else(|| self.error("is not a string"))
    }

    /// `N` finite numbers; nested lists (a matrix as a list of rows) count as one flat list.
    ///
    /// # Errors
    /// When this value is no list of numbers or has another length.
    pub fn numbers<const N: usize>(&self) -> Result<[f64; N], DatasetError> {
        let mut values = Vec::with_capacity(N);
        for item in self.items()? {
            match item.value {
                Value::Array(_) => {
                    for inner in item.items()? {
                        values.push(inner.number()?);
                    }
                }
                _ => values.push(item.number()?),
            }
        }
        let found = values.len();
        values.try_into().map_err(|_| self.error(format!("expected {N} numbers, found {found}")))
    }

    /// The pose \[m\] of the members `rotation` (nine row-major entries) and `translation_mm`.
    ///
    /// # Errors
    /// When one is absent, not finite, or no rotation.
    pub fn pose(
        &self,
        rotation: &str,
        translation_mm: &str,
    ) -> Result<Isometry3<f64>, DatasetError> {
        let (r, t) = (self.get(rotation)?, self.get(translation_mm)?);
        Ok(Isometry3::from_parts(
            translation_from_mm(&t.numbers()?).map_err(|e| t.error(e))?,
            rotation_from_row_major(&r.numbers()?).map_err(|e| r.error(e))?,
        ))
    }

    /// Three finite numbers as a vector, in the file's unit.
    ///
    /// # Errors
    /// When this value is no list of three numbers.
    pub fn vector(&self) -> Result<Vector3<f64>, DatasetError> {
        self.numbers::<3>().map(Vector3::from)
    }

    fn member(&self, name: &str, value: &'a Value) -> Entry<'a> {
        Entry { file: self.file, field: format!("{}.{name}", self.field), value }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> Result<JsonFile, DatasetError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scene.json");
        fs::write(&path, text).unwrap();
        JsonFile::read(&path)
    }

    #[test]
    fn broken_absent_and_misshapen_files_are_named() {
        let error = file(r#"{"0": {"cam_K": [1,"#).unwrap_err();
        assert!(matches!(&error, DatasetError::Malformed { .. }));
        assert!(error.to_string().contains("scene.json: not valid JSON"), "{error}");
        assert!(matches!(file("[1, 2]"), Err(DatasetError::Malformed { .. })));
        let absent = JsonFile::read(Path::new("no/such/scene.json")).unwrap_err();
        assert_eq!(absent, DatasetError::Missing { file: "no/such/scene.json".into() });
    }

    #[test]
    fn a_fault_names_its_field() {
        let f = file(r#"{"3": {"a": [{"b": [1, 2]}], "s": 1, "n": "x", "i": -1}}"#).unwrap();
        let e = f.entry(3).unwrap();
        let at = |r: Result<(), DatasetError>| match r.unwrap_err() {
            DatasetError::Field { field, problem, .. } => format!("{field}: {problem}"),
            other => other.to_string(),
        };
        let b = e.get("a").unwrap().items().unwrap()[0].get("b").unwrap();
        assert_eq!(at(b.numbers::<3>().map(drop)), "3.a[0].b: expected 3 numbers, found 2");
        assert_eq!(at(e.get("zz").map(drop)), "3.zz: is missing");
        assert_eq!(at(e.get("s").unwrap().text().map(drop)), "3.s: is not a string");
        assert_eq!(at(e.get("n").unwrap().number().map(drop)), "3.n: is not a finite number");
        assert_eq!(at(e.get("i").unwrap().id().map(drop)), "3.i: is not an id");
        assert_eq!(at(e.get("i").unwrap().positive().map(drop)), "3.i: must be above zero");
        assert_eq!(at(e.get("n").unwrap().items().map(drop)), "3.n: is not a list");
        assert_eq!(at(e.get("n").unwrap().members().map(drop)), "3.n: is not an object");
        assert!(matches!(f.entry(4), Err(DatasetError::NoEntry { key, .. }) if key == "4"));
    }

    #[test]
    fn nan_spoils_only_its_own_field() {
        let f = file(r#"{"0": {"t": [1, NaN, -Infinity], "name": "a NaN \" in a string"}, "1": {"t": [1, 2, 3]}}"#).unwrap();
        let error = f.entry(0).unwrap().get("t").unwrap().numbers::<3>().unwrap_err();
        assert!(error.to_string().contains("0.t[1]: is not a finite number"), "{error}");
        assert_eq!(
            f.entry(0).unwrap().get("name").unwrap().text().unwrap(),
            "a NaN \" in a string"
        );
        assert_eq!(f.entry(1).unwrap().get("t").unwrap().numbers(), Ok([1.0, 2.0, 3.0]));
    }

    #[test]
    fn nan_in_an_optional_field_is_not_absence() {
        let f = file(r#"{"0": {"scale": NaN, "none": null}}"#).unwrap();
        let entry = f.entry(0).unwrap();
        assert!(entry.find("none").unwrap().is_none());
        let error = entry.find("scale").unwrap().unwrap().positive().unwrap_err();
        assert!(error.to_string().contains("0.scale: is not a finite number"), "{error}");
    }

    #[test]
    fn poses_are_checked_and_brought_to_meters() {
        let f = file(
            r#"{"0": {"R": [0, -1, 0, 1, 0, 0, 0, 0, 1], "t": [1, 2, 3], "flat": [[1, 0, 0], [0, 2, 0], [0, 0, 1]]}}"#,
        );
        let f = f.unwrap();
        let e = f.entry(0).unwrap();
        let pose = e.pose("R", "t").unwrap();
        assert!((pose.translation.vector - Vector3::new(0.001, 0.002, 0.003)).norm() < 1e-18);
        assert!((pose.rotation * Vector3::x() - Vector3::y()).norm() < 1e-15);
        let error = e.pose("flat", "t").unwrap_err();
        assert!(error.to_string().contains("0.flat: not orthonormal"), "{error}");
    }
}
