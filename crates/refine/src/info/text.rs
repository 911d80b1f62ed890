//! JSON as aligned lines.

use std::fmt::{Formatter, Result};

use serde_json::{Map, Value};

use crate::evaluate::metrics::Table;

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
                if rows > 0 {
                    let table = table(list, rows).to_string();
                    table.lines().try_for_each(|line| writeln!(f, "{:indent$}  {line}", ""))?;
                }
            }
            value => writeln!(f, "{:indent$}{name:<width$}  {}", "", text(value))?,
        }
    }
    Ok(())
}

/// The first `rows` of a list of objects, with the fields of the first one as columns, `id` and `name` before others.
fn table(list: &[Value], rows: usize) -> Table {
    let mut columns: Vec<&String> =
        list.first().and_then(Value::as_object).into_iter().flat_map(Map::keys).collect();
    columns.sort_by_key(|name| !matches!(name.as_str(), "id" | "name"));
    let mut table = Table::new(columns.iter().copied());
    for row in list.iter().take(rows) {
        table.push(
            columns.iter().map(|name| row.get(*name).map(text).unwrap_or_default()).collect(),
        );
    }
    table
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
        let head = "x: frame\n  empty    none\n  hand\n    joints  3\n  inertia  0.000000001 0, 0 2\n  lens     yes\n  mass_kg  0.3\n  rows     30 (--all lists all)\n    name      child  limits\n    --------  -----  ------\n    joint 0       b     0 0\n";
        assert!(text.starts_with(head) && text.ends_with("  scale    -\n"), "{text}");
        assert_eq!(text.lines().count(), 9 + 2 + 24);
        assert_eq!(format!("{:#}", described("robot")).lines().count(), 9 + 2 + 30);
        assert_eq!(described("robot").to_string().lines().count(), 9);
    }
}
