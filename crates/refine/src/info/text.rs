//! JSON as aligned lines.

use std::fmt::{Formatter, Result};

use serde_json::{Map, Value};

/// Writes a line a field, nested objects indented below their names, and tables of up to `rows` rows.
pub(super) fn write_fields(
    f: &mut Formatter<'_>,
    fields: &Map<String, Value>,
    depth: usize,
    rows: usize,
) -> Result {
    let (indent, width) = (2 * depth, fields.keys().map(String::len).max().unwrap_or(0));
    for (name, value) in fields {
        match value {
            Value::Object(inner) => {
                writeln!(f, "{:indent$}{name}", "")?;
                write_fields(f, inner, depth + 1, rows)?;
            }
            Value::Array(list) if list.iter().any(Value::is_object) => {
                let more = if list.len() > rows { " (--all lists all)" } else { "" };
                writeln!(f, "{:indent$}{name:<width$}  {}{more}", "", list.len())?;
                write_table(f, list, indent + 2, rows)?;
            }
            value => writeln!(f, "{:indent$}{name:<width$}  {}", "", text(value))?,
        }
    }
    Ok(())
}

/// Writes the first `rows` of a list of objects with the fields of the first one as columns, `id` and `name` before others.
fn write_table(f: &mut Formatter<'_>, list: &[Value], indent: usize, rows: usize) -> Result {
    let list = &list[..rows.min(list.len())];
    let Some(Value::Object(first)) = list.first() else { return Ok(()) };
    let mut columns: Vec<&String> = first.keys().collect();
    columns.sort_by_key(|name| !matches!(name.as_str(), "id" | "name"));
    let cell = |row: &Value, name: &str| row.get(name).map(text).unwrap_or_default();
    let width = |name: &&String| {
        let widths = list.iter().map(|row| cell(row, name).chars().count());
        widths.chain([name.len()]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = columns.iter().map(width).collect();
    let heads = columns.iter().map(|name| (*name).clone()).collect();
    let cells = list.iter().map(|row| columns.iter().map(|name| cell(row, name)).collect());
    for line in std::iter::once::<Vec<String>>(heads).chain(cells) {
        let padded = line.iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}"));
        let line = padded.collect::<Vec<_>>().join("  ");
        writeln!(f, "{:indent$}{}", "", line.trim_end())?;
    }
    Ok(())
}

/// A value on one line: numbers to six digits, rows of a matrix after commas.
fn text(value: &Value) -> String {
    match value {
        Value::Null => "-".to_owned(),
        Value::Bool(set) => if *set { "yes" } else { "no" }.to_owned(),
        Value::String(text) => text.clone(),
        Value::Number(number) if number.is_f64() => {
            let digits = format!("{:.5e}", number.as_f64().unwrap_or(f64::NAN));
            digits.parse::<f64>().map_or(digits, |rounded| rounded.to_string())
        }
        Value::Array(list) if list.is_empty() => "none".to_owned(),
        Value::Array(list) => {
            let separator = if list.iter().any(Value::is_array) { ", " } else { " " };
            list.iter().map(text).collect::<Vec<_>>().join(separator)
        }
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use serde_json::json;

    use crate::info::Description;

    #[test]
    fn fields_are_aligned_and_tables_are_cut() {
        let row =
            |k: usize| json!({ "child": "b", "limits": [0.0, k], "name": format!("joint {k}") });
        let rows: Vec<_> = (0..30).map(row).collect();
        let value = json!({ "mass_kg": 0.1 + 0.2, "hand": { "joints": 3 }, "rows": rows, "scale": null,
            "inertia": [[1e-9, 0.0], [0.0, 2.0]], "empty": [], "lens": true });
        let fields = value.as_object().cloned().unwrap_or_default();
        let described = |kind| Description {
            path: PathBuf::from("x"),
            kind,
            fields: fields.clone(),
            warnings: vec![],
        };
        let text = described("frame").to_string();
        let head = "x: frame\n  empty    none\n  hand\n    joints  3\n  inertia  0.000000001 0, 0 2\n  lens     yes\n  mass_kg  0.3\n  rows     30 (--all lists all)\n    name      child  limits\n    joint 0   b      0 0\n";
        assert!(text.starts_with(head) && text.ends_with("  scale    -\n"), "{text}");
        assert_eq!(text.lines().count(), 9 + 1 + 24);
        assert_eq!(format!("{:#}", described("robot")).lines().count(), 9 + 1 + 30);
        assert_eq!(described("robot").to_string().lines().count(), 9);
    }
}
