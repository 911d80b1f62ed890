//! JSON in which no key is there twice: which of two values is meant, nobody knows.

use std::collections::BTreeMap;
use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Number, Value};

/// The value in `bytes`.
///
/// # Errors
/// What is not JSON, and an object with a key twice; with line and column.
pub(crate) fn parse_json(bytes: &[u8]) -> Result<Value, serde_json::Error> {
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    let value = Unique.deserialize(&mut deserializer)?;
    deserializer.end().map(|()| value)
}

struct Unique;

impl<'de> DeserializeSeed<'de> for Unique {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Unique {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Value, E> {
        Number::from_f64(value).map(Value::Number).ok_or_else(|| E::custom("number out of range"))
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        while let Some(value) = list.next_element_seed(Unique)? {
            values.push(value);
        }
        Ok(values.into())
    }

    fn visit_map<A: MapAccess<'de>>(self, fields: A) -> Result<Value, A::Error> {
        let map = unique_fields(fields, |fields| fields.next_value_seed(Unique))?;
        Ok(map.into_iter().collect())
    }
}

/// The fields of an object, whose values `value` reads.
///
/// # Errors
/// Those of `value`, and a key that is there twice.
pub(super) fn unique_fields<'de, A: MapAccess<'de>, V>(
    mut fields: A,
    value: impl Fn(&mut A) -> Result<V, A::Error>,
) -> Result<BTreeMap<String, V>, A::Error> {
    let mut all = BTreeMap::new();
    while let Some(key) = fields.next_key::<String>()? {
        if all.contains_key(&key) {
            return Err(A::Error::custom(format!("the key {key:?} is there twice")));
        }
        all.insert(key, value(&mut fields)?);
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_all_of_json_and_no_key_twice() {
        let text = r#"{"a": [null, true, -1, 18446744073709551615, 0.1, "x\n"], "b": {"a": {}}}"#;
        let plain: Value = serde_json::from_str(text).unwrap();
        assert_eq!(parse_json(text.as_bytes()).unwrap(), plain);
        let error = parse_json(b"{\"a\": {\"b\": 1,\n \"b\": 2}}").unwrap_err().to_string();
        assert_eq!(error, "the key \"b\" is there twice at line 2 column 4");
        assert!(parse_json(b"{} {}").is_err() && parse_json(b"[1e999]").is_err());
        assert!(parse_json("[".repeat(100_000).as_bytes()).is_err());
    }
}
