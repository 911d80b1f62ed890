//! Settings from files and dicts.

use std::path::PathBuf;

use prehend_refine::Settings;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat};

use crate::error::{Raise, wrong};

/// The settings that `given` has: the path of a TOML file, as `prehend settings` prints it, or a dict of values, of dicts in it or with dots in their
/// names.
pub(super) fn settings(given: Option<&Bound<'_, PyAny>>) -> PyResult<Settings> {
    let Some(given) = given else { return Ok(Settings::default()) };
    if let Ok(values) = given.cast::<PyDict>() {
        let mut settings = Settings::default();
        set_all(&mut settings, "", values)?;
        return Ok(settings);
    }
    let file: PathBuf = given
        .extract()
        .map_err(|_| wrong("settings: a dict is expected, or the path of a TOML file"))?;
    Settings::load(&file).raise()
}

/// Changes the settings of a table at `path`.
fn set_all(settings: &mut Settings, path: &str, values: &Bound<'_, PyDict>) -> PyResult<()> {
    for (name, value) in values {
        let name: String = name.extract()?;
        let path = if path.is_empty() { name } else { format!("{path}.{name}") };
        match value.cast::<PyDict>() {
            Ok(table) => set_all(settings, &path, table)?,
            Err(_) => settings
                .set(&path, &text(&value)?)
                .map_err(|error| wrong(format!("settings: {error}")))?,
        }
    }
    Ok(())
}

/// A value as TOML has it.
fn text(value: &Bound<'_, PyAny>) -> PyResult<String> {
    if value.is_instance_of::<PyFloat>() && !value.is_instance_of::<PyBool>() {
        return Ok(format!("{:?}", value.extract::<f64>()?));
    }
    // Lists, text and whole numbers are the same there.
    value.py().import("json")?.call_method1("dumps", (value,))?.extract()
}
