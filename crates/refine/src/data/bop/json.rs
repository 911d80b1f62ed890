//! JSON files keyed by image or object id, read such that a fault names its file and field.
//!
//! Entries are converted one by one: a fault in the entry of one image leaves the others usable. That includes `NaN` and
//! `Infinity`, which other writers emit and JSON does not know.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;
use serde::de::{DeserializeOwned, DeserializeSeed, Deserializer, Error, SeqAccess, Visitor};
use serde_json::{Map, Value};

use super::error::DatasetError;
use super::pose::{PoseFault, rotation_from_row_major, translation_from_mm};

/// A JSON file whose top level is an object; it is read once, when something of it is first asked for.
#[derive(Debug)]
pub(super) struct JsonFile {
    path: PathBuf,
    root: OnceLock<Result<Map<String, Value>, DatasetError>>,
}

impl JsonFile {
    pub(super) fn new(path: PathBuf) -> Self {
        Self { path, root: OnceLock::new() }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the file is there, readable or not.
    pub(super) fn exists(&self) -> bool {
        self.path.exists()
    }

    /// The top-level object.
    ///
    /// # Errors
    /// When the file is absent, cannot be read, is not JSON, or its top level is no object.
    pub(super) fn root(&self) -> Result<&Map<String, Value>, DatasetError> {
        self.root.get_or_init(|| read(&self.path)).as_ref().map_err(Clone::clone)
    }

    /// The entry of an image or object id.
    ///
    /// # Errors
    /// Those of [`JsonFile::root`], [`DatasetError::NoEntry`], and [`DatasetError::Field`] for the first field that is
    /// absent or not of its type.
    pub(super) fn entry<T: DeserializeOwned>(&self, id: u32) -> Result<T, DatasetError> {
        let key = id.to_string();
        let Some(value) = self.root()?.get(&key) else {
            return Err(DatasetError::NoEntry { file: self.path.clone(), key });
        };
        serde_path_to_error::deserialize(value).map_err(|error| {
            let (path, problem) = (error.path().to_string(), error.inner().to_string());
            let (absent, problem) = plain(&problem);
            let mut field = key;
            if path != "." {
                field += if path.starts_with('[') { "" } else { "." };
                field += &path;
            }
            field.extend(absent.iter().flat_map(|name| [".", name]));
            DatasetError::Field { file: self.path.clone(), field, problem }
        })
    }
}

/// What serde says of a value, in words that name no Rust type; first the name of the field if it is absent.
fn plain(problem: &str) -> (Option<&str>, String) {
    if let Some(name) = problem.strip_prefix("missing field `").and_then(|p| p.split('`').next()) {
        return (Some(name), "is missing".into());
    }
    let Some((found, expected)) = problem.split_once(", expected ") else {
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

fn read(path: &Path) -> Result<Map<String, Value>, DatasetError> {
    let bytes = fs::read(path).map_err(|e| DatasetError::reading(path, &e))?;
    let parsed = serde_json::from_slice(&bytes).or_else(|error| {
        // Report the strict parser's complaint unless non-finite numbers were all that stopped it.
        serde_json::from_slice(&false_for_non_finite(&bytes)).map_err(|_| error)
    });
    match parsed {
        Ok(Value::Object(root)) => Ok(root),
        Ok(_) => Err(DatasetError::malformed(path, "the top level is not a JSON object")),
        Err(e) => Err(DatasetError::malformed(path, format!("not valid JSON: {e}"))),
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

/// `N` numbers; nested lists (a matrix as a list of rows) count as one flat list.
pub(super) struct Numbers<const N: usize>(pub(super) [f64; N]);

impl<'de, const N: usize> Deserialize<'de> for Numbers<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut values = Vec::with_capacity(N);
        Flat { out: &mut values, nested: false }.deserialize(deserializer)?;
        let found = values.len();
        let array = values.try_into();
        array
            .map(Self)
            .map_err(|_| D::Error::custom(format!("expected {N} numbers, found {found}")))
    }
}

/// Appends a number, or those of a list, to `out`.
struct Flat<'a> {
    out: &'a mut Vec<f64>,
    nested: bool,
}

impl<'de> DeserializeSeed<'de> for Flat<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Flat<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.nested { "a finite number" } else { "a list" })
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<(), E> {
        if !self.nested {
            return Err(E::invalid_type(serde::de::Unexpected::Float(value), &self));
        }
        self.out.push(value);
        Ok(())
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<(), E> {
        self.visit_f64(value as f64)
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<(), E> {
        self.visit_f64(value as f64)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        while list.next_element_seed(Flat { out: &mut *self.out, nested: true })?.is_some() {}
        Ok(())
    }
}

/// A number above zero.
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "f64")]
pub(super) struct Positive(pub(super) f64);

impl TryFrom<f64> for Positive {
    type Error = &'static str;

    fn try_from(value: f64) -> Result<Self, &'static str> {
        if value > 0.0 { Ok(Self(value)) } else { Err("must be above zero") }
    }
}

/// A vector in the unit of the file.
#[derive(Deserialize)]
#[serde(from = "Numbers<3>")]
pub(super) struct Vector(pub(super) Vector3<f64>);

impl From<Numbers<3>> for Vector {
    fn from(numbers: Numbers<3>) -> Self {
        Self(numbers.0.into())
    }
}

/// A rotation of nine row-major entries.
#[derive(Deserialize)]
#[serde(try_from = "Numbers<9>")]
pub(super) struct Rotation(pub(super) UnitQuaternion<f64>);

impl TryFrom<Numbers<9>> for Rotation {
    type Error = PoseFault;

    fn try_from(numbers: Numbers<9>) -> Result<Self, PoseFault> {
        rotation_from_row_major(&numbers.0).map(Self)
    }
}

/// A translation \[m\] of three millimeter values.
#[derive(Deserialize)]
#[serde(try_from = "Numbers<3>")]
pub(super) struct Millimeters(pub(super) Translation3<f64>);

impl TryFrom<Numbers<3>> for Millimeters {
    type Error = PoseFault;

    fn try_from(numbers: Numbers<3>) -> Result<Self, PoseFault> {
        translation_from_mm(&numbers.0).map(Self)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn file(text: &str) -> JsonFile {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scene.json");
        fs::write(&path, text).unwrap();
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
    fn broken_absent_and_misshapen_files_are_named() {
        let error = file(r#"{"0": {"cam_K": [1,"#).root().unwrap_err();
        assert!(matches!(&error, DatasetError::Malformed { .. }));
        assert!(error.to_string().contains("scene.json: not valid JSON"), "{error}");
        assert!(matches!(file("[1, 2]").root(), Err(DatasetError::Malformed { .. })));
        let absent = JsonFile::new("no/such/scene.json".into());
        let expected = DatasetError::Missing { file: "no/such/scene.json".into() };
        assert_eq!(absent.root().unwrap_err(), expected);
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
        }
        let f = file(
            r#"{"0": {"t": [1, NaN, -Infinity], "name": "a NaN \" in a string"}, "1": {"t": [1, 2, 3]}}"#,
        );
        assert_eq!(fault::<Placed>(&f, 0), "0.t[1]: is not a finite number");
        assert_eq!(f.entry(0), Ok(Named { name: "a NaN \" in a string".into() }));
        assert_eq!(f.entry::<Placed>(1).map(|p| p.t.0), Ok([1.0, 2.0, 3.0]));
    }

    #[test]
    fn nan_in_an_optional_field_is_not_absence() {
        #[derive(Deserialize)]
        struct Scaled {
            none: Option<Positive>,
            scale: Option<Positive>,
        }
        let f = file(r#"{"0": {"scale": NaN, "none": null}, "1": {"scale": 2, "none": null}}"#);
        assert_eq!(fault::<Scaled>(&f, 0), "0.scale: is not a finite number");
        let read: Scaled = f.entry(1).unwrap();
        assert!(read.none.is_none() && read.scale.is_some());
    }

    #[test]
    fn poses_are_checked_and_brought_to_meters() {
        #[derive(Deserialize)]
        struct Pose {
            #[serde(rename = "R")]
            rotation: Rotation,
            t: Millimeters,
        }
        let f = file(
            r#"{"0": {"R": [0, -1, 0, 1, 0, 0, 0, 0, 1], "t": [1, 2, 3]},
                "1": {"R": [[1, 0, 0], [0, 2, 0], [0, 0, 1]], "t": [1, 2, 3]}}"#,
        );
        let pose: Pose = f.entry(0).unwrap();
        assert!((pose.t.0.vector - Vector3::new(0.001, 0.002, 0.003)).norm() < 1e-18);
        assert!((pose.rotation.0 * Vector3::x() - Vector3::y()).norm() < 1e-15);
        let error = fault::<Pose>(&f, 1);
        assert!(error.contains("1.R: not orthonormal"), "{error}");
    }
}
