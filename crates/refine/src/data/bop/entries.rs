//! The fields of a JSON object, each a value once it is asked for.

use std::collections::BTreeMap;
use std::fmt;

use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, Visitor};
use serde_json::Value;
use serde_json::value::RawValue;

use super::unique::{parse_json, unique_fields};

/// A JSON object whose fields are text: as values they would take ten times as much memory.
#[derive(Debug)]
pub(super) struct Entries(BTreeMap<String, Box<RawValue>>);

impl Entries {
    /// The object that `text` is. `NaN` and infinite numbers, which other writers emit and JSON does not know, are read as `false`.
    ///
    /// # Errors
    /// In words, if it is not JSON, no object, or has a field twice.
    pub(super) fn new(text: &[u8]) -> Result<Self, String> {
        let is_object = text.trim_ascii_start().starts_with(b"{");
        if !is_object && serde_json::from_slice::<IgnoredAny>(text).is_ok() {
            return Err("the top level is not a JSON object".into());
        }
        // The strict parser's complaint, unless non-finite numbers were all that stopped it.
        serde_json::from_slice(text)
            .or_else(|e| serde_json::from_slice(&false_for_non_finite(text)).map_err(|_| e))
            .map_err(|error| format!("not valid JSON: {error}"))
    }

    /// The value of a field, if it is there.
    ///
    /// # Errors
    /// In words, if it has a key twice or a number that is out of range.
    pub(super) fn get(&self, name: &str) -> Option<Result<Value, String>> {
        let text = self.0.get(name)?.get();
        Some(parse_json(text.as_bytes()).map_err(|error| error.to_string()))
    }

    pub(super) fn contains(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    pub(super) fn names(&self) -> impl Iterator<Item = &String> {
        self.0.keys()
    }
}

impl<'de> Deserialize<'de> for Entries {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Fields;

        impl<'de> Visitor<'de> for Fields {
            type Value = Entries;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a JSON object")
            }

            fn visit_map<A: MapAccess<'de>>(self, fields: A) -> Result<Entries, A::Error> {
                unique_fields(fields, A::next_value).map(Entries)
            }
        }

        deserializer.deserialize_map(Fields)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_parsed_when_they_are_asked_for() {
        let text = br#"{"1": {"a": NaN}, "2": {"b": 1, "b": 2}, "3": [1e999], "4": "Infinity"}"#;
        let entries = Entries::new(text).unwrap();
        assert_eq!(entries.names().collect::<Vec<_>>(), ["1", "2", "3", "4"]);
        assert!(entries.contains("4") && entries.get("5").is_none());
        assert_eq!(entries.get("1"), Some(Ok(serde_json::json!({"a": false}))));
        assert_eq!(entries.get("4"), Some(Ok("Infinity".into())));
        let fault = |name| entries.get(name).unwrap().unwrap_err();
        assert_eq!(fault("2"), "the key \"b\" is there twice at line 1 column 12");
        assert!(fault("3").starts_with("number out of range"), "{}", fault("3"));
    }

    #[test]
    fn what_is_no_object_is_refused() {
        let error = |text: &[u8]| Entries::new(text).unwrap_err();
        assert_eq!(error(b" [1]"), "the top level is not a JSON object");
        assert_eq!(
            error(br#"{"0": 1, "0": 2}"#),
            "not valid JSON: the key \"0\" is there twice at line 1 column 12"
        );
        assert!(error(b"{\n\"0\": nan}").contains(" at line 2 column "));
        assert!(error(b"").starts_with("not valid JSON: EOF"));
        assert!(error(b"{} {}").starts_with("not valid JSON: trailing"));
        assert!(error(b"{\"0\": \xff}").starts_with("not valid JSON: "));
    }
}
