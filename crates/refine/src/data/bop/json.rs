//! JSON files, read such that a fault names its file and field.
//!
//! RawEntries of files that are keyed by image or object id are converted one by one: a fault in one leaves the others usable. That includes `NaN` and
//! `Infinity`, which other writers emit and JSON does not know.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use serde::de::{Deserialize, DeserializeOwned, Deserializer, Error, MapAccess, Visitor};
use serde_json::value::RawValue;

use super::error::DatasetError;
use super::files::read_bytes;
use super::pose::{Rotation, rotations_off};

/// A JSON object in which no key is there twice: which of two values is meant, nobody knows.
#[derive(Debug, Default)]
pub(crate) struct UniqueMap<V>(pub(crate) BTreeMap<String, V>);

/// RawEntries as text: as values they would take ten times as much memory.
pub(super) type RawEntries = UniqueMap<Box<RawValue>>;

impl<'de, V: Deserialize<'de>> Deserialize<'de> for UniqueMap<V> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(UniqueVisitor(PhantomData))
    }
}

struct UniqueVisitor<V>(PhantomData<V>);

impl<'de, V: Deserialize<'de>> Visitor<'de> for UniqueVisitor<V> {
    type Value = UniqueMap<V>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut fields: A) -> Result<UniqueMap<V>, A::Error> {
        let mut all = BTreeMap::new();
        while let Some(key) = fields.next_key::<String>()? {
            if all.contains_key(&key) {
                return Err(A::Error::custom(format!("duplicate field `{key}`")));
            }
            all.insert(key, fields.next_value()?);
        }
        Ok(UniqueMap(all))
    }
}

/// A JSON file whose top level is an object; it is read once, when something of it is first asked for.
#[derive(Debug)]
pub(super) struct JsonFile {
    path: PathBuf,
    root: OnceLock<Result<RawEntries, DatasetError>>,
    /// Set when rotations were warned of that are not quite orthonormal.
    told: OnceLock<()>,
}

impl JsonFile {
    pub(super) fn new(path: PathBuf) -> Self {
        Self { path, root: OnceLock::new(), told: OnceLock::new() }
    }

    /// File with `entries` in place of its content.
    pub(super) fn with_entries(path: PathBuf, entries: RawEntries) -> Self {
        Self { root: Ok(entries).into(), ..Self::new(path) }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the file is there, readable or not.
    pub(super) fn exists(&self) -> bool {
        self.path.exists()
    }

    /// The fields of the top-level object; names that are numbers are without zeros before them.
    ///
    /// # Errors
    /// When the file is absent, cannot be read, is not JSON, its top level is no object, or two names are the same number.
    pub(super) fn root(&self) -> Result<&BTreeMap<String, Box<RawValue>>, DatasetError> {
        let read = || by_number(&self.path, read_entries(&self.path)?);
        let root = self.root.get_or_init(read).as_ref();
        root.map(|entries| &entries.0).map_err(Clone::clone)
    }

    /// A field of the top level, if it is there.
    ///
    /// # Errors
    /// Those of [`JsonFile::root`], and [`DatasetError::Unusable`] if it is not of its type.
    pub(super) fn field<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>, DatasetError> {
        let text = self.root()?.get(name);
        text.map(|text| convert(&self.path, name, text)).transpose()
    }

    /// The entry of an image or object id.
    ///
    /// # Errors
    /// Those of [`JsonFile::root`], [`DatasetError::Missing`] without an entry, and [`DatasetError::Unusable`] for the first field that is
    /// absent or not of its type.
    pub(super) fn entry<T: DeserializeOwned>(&self, id: u32) -> Result<T, DatasetError> {
        let key = id.to_string();
        let entry = self.field(&key)?;
        entry.ok_or_else(|| DatasetError::missing(&self.path, format!("no entry {key:?}")))
    }

    /// The entries of an image that has one or a list of them, each with the name of its field.
    ///
    /// # Errors
    /// Those of [`JsonFile::entry`].
    pub(super) fn entries<T: DeserializeOwned>(
        &self,
        id: u32,
    ) -> Result<Vec<(String, T)>, DatasetError> {
        let one =
            |name: String, text: &RawValue| Ok((name.clone(), convert(&self.path, &name, text)?));
        let text: Box<RawValue> = self.entry(id)?;
        if !text.get().starts_with('[') {
            return Ok(vec![one(id.to_string(), &text)?]);
        }
        let all: Vec<Box<RawValue>> = convert(&self.path, &id.to_string(), &text)?;
        let named = all.iter().enumerate();
        named.map(|(k, text)| one(format!("{id}[{k}]"), text)).collect()
    }

    /// Warns, once a file, of rotations that are not quite orthonormal.
    pub(super) fn check_rotations<'r>(&self, rotations: impl Iterator<Item = &'r Rotation>) {
        if let Some(largest) = rotations.filter_map(|rotation| rotation.deviation).reduce(f64::max)
        {
            self.told.get_or_init(|| log::warn!("{}", rotations_off(&self.path, largest)));
        }
    }

    /// An error about a field.
    pub(super) fn fault(&self, field: &str, problem: impl ToString) -> DatasetError {
        DatasetError::field(&self.path, field, problem)
    }
}

/// The entry `name` of a file.
///
/// # Errors
/// [`DatasetError::Unusable`] for the first field that is absent or not of its type.
pub(super) fn convert<T: DeserializeOwned>(
    file: &Path,
    name: &str,
    text: &RawValue,
) -> Result<T, DatasetError> {
    let mut json = serde_json::Deserializer::from_str(text.get());
    serde_path_to_error::deserialize(&mut json).map_err(|error| {
        let (at, inner) = (error.path().to_string(), error.inner());
        let dot = if at.starts_with('[') { "" } else { "." };
        let field = if at == "." { name.to_owned() } else { format!("{name}{dot}{at}") };
        // Places are those in the entry, not in the file.
        let (line, column, problem) = (inner.line(), inner.column(), inner.to_string());
        let place = format!(" at line {line} column {column}");
        DatasetError::field(file, &field, problem.trim_end_matches(&place))
    })
}

/// Entries of a file as text, in which numbers need not be finite.
///
/// # Errors
/// Those of [`read_json`].
pub(super) fn read_entries<T: DeserializeOwned>(file: &Path) -> Result<T, DatasetError> {
    let text = read_bytes(file)?;
    // The complaint about the text as it is, unless non-finite numbers were all that stopped it.
    from_text(file, &text).or_else(|e| from_text(file, &finite(&text)).map_err(|_| e))
}

/// Entries whose names, if they are numbers, are as BOP spells them: some writers put zeros before them.
///
/// # Errors
/// [`DatasetError::Unusable`] for two names of one number.
fn by_number(file: &Path, entries: RawEntries) -> Result<RawEntries, DatasetError> {
    let (mut all, mut names) = (BTreeMap::new(), BTreeMap::new());
    for (name, entry) in entries.0 {
        let number = name.parse::<u32>().map_or_else(|_| name.clone(), |n| n.to_string());
        if let Some(other) = names.insert(number.clone(), name.clone()) {
            let problem = format!("the entries {other:?} and {name:?} are of the same number");
            return Err(DatasetError::unusable(file, problem));
        }
        all.insert(number, entry);
    }
    Ok(UniqueMap(all))
}

/// Content of a file of one layout.
///
/// # Errors
/// When the file is absent, cannot be read or is not JSON, and [`DatasetError::Unusable`] for the first field that is absent or
/// not of its type, with line and column.
pub(crate) fn read_json<T: DeserializeOwned>(file: &Path) -> Result<T, DatasetError> {
    from_text(file, &read_bytes(file)?)
}

/// Content of a file of that `text`, which may begin with a byte order mark.
pub(super) fn from_text<T: DeserializeOwned>(file: &Path, text: &[u8]) -> Result<T, DatasetError> {
    let text = text.strip_prefix("\u{feff}".as_bytes()).unwrap_or(text);
    let broken =
        |e: serde_json::Error| DatasetError::unusable(file, format!("not valid JSON: {e}"));
    let mut json = serde_json::Deserializer::from_slice(text);
    let value = serde_path_to_error::deserialize(&mut json).map_err(|error| {
        let path = error.path().to_string();
        match error.into_inner() {
            inner if !inner.is_data() => broken(inner),
            inner if path == "." => DatasetError::unusable(file, inner),
            inner => DatasetError::field(file, &path, inner),
        }
    })?;
    json.end().map(|()| value).map_err(broken)
}

/// Replaces `NaN`, `Infinity` and `-Infinity` outside strings by a number that is out of range: unlike `null`, it does not count as absent.
fn finite(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len());
    let (mut rest, mut in_string) = (bytes, false);
    while let Some((&byte, after)) = rest.split_first() {
        let words = [&b"NaN"[..], b"-Infinity", b"Infinity"];
        let word = words.into_iter().find_map(|word| rest.strip_prefix(word));
        rest = match (in_string, byte, word) {
            (true, b'\\', _) => {
                out.push(byte);
                out.extend(after.first());
                after.get(1..).unwrap_or_default()
            }
            (false, _, Some(after)) => {
                out.extend(b"1e999");
                after
            }
            _ => {
                in_string ^= byte == b'"';
                out.push(byte);
                after
            }
        };
    }
    out
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;
    use crate::data::bop::{Numbers, Positive};

    fn file(text: &str) -> JsonFile {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scene.json");
        std::fs::write(&path, text).unwrap();
        let file = JsonFile::new(path);
        let _ = file.root();
        file
    }

    /// Problem of reading entry `id` as a `T`.
    fn fault<T: DeserializeOwned>(file: &JsonFile, id: u32) -> String {
        match file.entry::<T>(id).map(|_| ()).unwrap_err() {
            DatasetError::Unusable { problem, .. } => problem,
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
        type Of<T> = UniqueMap<T>;
        let f = file(
            r#"{"3": {"a": [{"b": [1, 2]}]}, "4": {}, "5": {"s": 1}, "6": {"n": "x"}, "7": {"i": -1}, "8": {"k": ["500"]}}"#,
        );
        assert_eq!(fault::<A>(&f, 3), "3.a[0].b: expected 3 numbers, found 2");
        assert_eq!(fault::<A>(&f, 4), "4: missing field `a`");
        assert_eq!(fault::<Of<String>>(&f, 5), "5.s: invalid type: integer `1`, expected a string");
        assert_eq!(fault::<Of<f64>>(&f, 6), "6.n: invalid type: string \"x\", expected f64");
        assert_eq!(fault::<Of<u32>>(&f, 7), "7.i: invalid value: integer `-1`, expected u32");
        assert_eq!(fault::<Of<Positive>>(&f, 7), "7.i: must be above zero");
        assert_eq!(
            fault::<Of<Numbers<3>>>(&f, 5),
            "5.s: invalid type: integer `1`, expected a sequence"
        );
        assert_eq!(
            fault::<Of<Of<f64>>>(&f, 6),
            "6.n: invalid type: string \"x\", expected an object"
        );
        assert_eq!(fault::<Of<Numbers<1>>>(&f, 8), "8.k[0]: is not a number");
        assert!(fault::<A>(&f, 9).ends_with("scene.json: no entry \"9\""));
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
        assert_eq!(fault::<Placed>(&f, 0), "0.t[1]: number out of range");
        assert_eq!(f.entry(0), Ok(Named { name: "a NaN \" in a string".into() }));
        assert_eq!(f.entry::<Placed>(1).map(|p| p.t.0), Ok([1.0, 2.0, 3.0]));
        // Nor does it count as the absence of an optional field.
        assert!(f.entry::<Placed>(2).unwrap().scale.is_none());
        assert_eq!(fault::<Placed>(&f, 3), "3.scale: number out of range");
    }

    #[test]
    fn entries_are_parsed_when_they_are_asked_for() {
        let text = r#"{"1": {"a": NaN}, "2": {"b": 1, "b": 2}, "3": [1e999], "4": "Infinity"}"#;
        let f = file(text);
        assert_eq!(f.root().unwrap().keys().collect::<Vec<_>>(), ["1", "2", "3", "4"]);
        assert_eq!(f.entry::<String>(4).unwrap(), "Infinity");
        assert_eq!(fault::<UniqueMap<f64>>(&f, 2), "2: duplicate field `b`");
        assert_eq!(fault::<Vec<f64>>(&f, 3), "3[0]: number out of range");
        assert_eq!(f.entries::<UniqueMap<serde::de::IgnoredAny>>(1).unwrap()[0].0, "1");
    }

    #[test]
    fn a_byte_order_mark_says_nothing() {
        let f = file("\u{feff}{\"1\": 7, \"2\": NaN}");
        assert_eq!((f.entry(1), fault::<f64>(&f, 2).as_str()), (Ok(7), "2: number out of range"));
        let read = from_text::<Vec<u32>>(Path::new("list.json"), "\u{feff}[3]".as_bytes());
        assert_eq!(read, Ok(vec![3]));
    }

    #[test]
    fn zeros_before_numbers_say_nothing() {
        let f = file(r#"{"000000": 1, "000012": 2, "07": 3, "00x": 4}"#);
        assert_eq!((f.entry(0), f.entry(12), f.entry(7)), (Ok(1), Ok(2), Ok(3)));
        assert_eq!(f.root().unwrap().keys().collect::<Vec<_>>(), ["0", "00x", "12", "7"]);
        let error = file(r#"{"7": 1, "007": 2}"#).root().unwrap_err().to_string();
        let expected = "scene.json: the entries \"007\" and \"7\" are of the same number";
        assert!(error.ends_with(expected), "{error}");
    }

    #[test]
    fn what_is_no_object_is_refused() {
        let error = |text: &str| file(text).root().unwrap_err().to_string();
        let refused = [
            (" [1]", "scene.json: invalid type: sequence, expected an object at line 1"),
            (r#"{"0": 1, "0": 2}"#, "scene.json: duplicate field `0` at line 1 column 12"),
            ("{\n\"0\": nan}", "not valid JSON: expected ident at line 2"),
            ("", "not valid JSON: EOF"),
            ("{} {}", "not valid JSON: trailing"),
            ("{\"0\": [}", "not valid JSON: "),
        ];
        for (text, problem) in refused {
            assert!(error(text).contains(problem), "{}", error(text));
        }
        assert!(error(&"[".repeat(100_000)).contains("scene.json"));
    }
}
