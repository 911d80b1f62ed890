//! Settings as a TOML document that says what each of them is.

use std::collections::BTreeSet;
use std::fmt::{self, Write};

use schemars::schema_for;
use serde_json::Value as Json;
use toml::Value;

use super::Settings;
use crate::error::SettingsError;

/// Columns of a comment.
const WIDTH: usize = 110;

impl Settings {
    /// These settings as a TOML document: a line for each, by its path, and comments that say what it is.
    ///
    /// # Errors
    /// Those of [`to_toml`](Self::to_toml).
    pub fn document(&self) -> Result<String, SettingsError> {
        let wrong = |error: &dyn fmt::Display| SettingsError::value("settings", error);
        let values = Value::try_from(self).map_err(|error| wrong(&error))?;
        let root = Json::from(schema_for!(Self));
        let mut document =
            SettingsDocument { root: &root, text: String::new(), described: BTreeSet::new() };
        document.write("", &values, &root).map_err(|error| wrong(&error))?;
        Ok(document.text)
    }
}

struct SettingsDocument<'a> {
    root: &'a Json,
    text: String,
    /// Structures that were described before.
    described: BTreeSet<&'a str>,
}

impl<'a> SettingsDocument<'a> {
    /// Fields of a structure with their schemas; none of anything else.
    fn fields(&self, schema: &'a Json) -> impl Iterator<Item = (&'a String, &'a Json)> + use<'a> {
        let name = schema["$ref"].as_str().and_then(|name| name.strip_prefix('#'));
        let structure = name.and_then(|name| self.root.pointer(name)).unwrap_or(schema);
        structure["properties"].as_object().into_iter().flatten()
    }

    /// Writes what there is at `path`.
    fn write(&mut self, path: &str, value: &Value, schema: &'a Json) -> fmt::Result {
        let (Value::Table(table), Some(_)) = (value, self.fields(schema).next()) else {
            for (name, field) in self.fields(&schema["items"]) {
                self.comment(&format!("{name}: "), field)?;
            }
            let row = |row: &Value| format!("    {row},\n");
            return match value {
                Value::Array(rows) if rows.first().is_some_and(Value::is_table) => {
                    writeln!(self.text, "{path} = [\n{}]", rows.iter().map(row).collect::<String>())
                }
                value => writeln!(self.text, "{path} = {value}"),
            };
        };
        let is_new = schema["$ref"].as_str().is_none_or(|name| self.described.insert(name));
        for (name, field) in self.fields(schema) {
            let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
            if self.fields(field).next().is_some() {
                self.text.push('\n');
            }
            if is_new {
                self.comment("", field)?;
            }
            match table.get(name) {
                Some(value) => self.write(&path, value, field)?,
                None => writeln!(self.text, "# {path} =")?,
            }
        }
        Ok(())
    }

    /// Writes what a field is, in lines that are not too long.
    fn comment(&mut self, name: &str, field: &Json) -> fmt::Result {
        let Some(text) = field["description"].as_str() else { return Ok(()) };
        let mut line = String::from("#");
        for word in plain(&format!("{name}{text}")).split_whitespace() {
            if line.len() + word.len() >= WIDTH {
                writeln!(self.text, "{line}")?;
                line.truncate(1);
            }
            line += " ";
            line += word;
        }
        writeln!(self.text, "{line}")
    }
}

/// A comment of rustdoc without its links.
fn plain(text: &str) -> String {
    let mut text = text.replace("[`", "`").replace("`]", "`");
    while let Some(start) = text.find("`(") {
        let end = text[start..].find(')').map_or(text.len(), |end| start + end + 1);
        text.replace_range(start + 1..end, "");
    }
    text.replace("\\[", "[").replace("\\]", "]")
}
