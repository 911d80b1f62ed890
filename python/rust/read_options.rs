//! Options of reading robots.

use std::collections::BTreeMap;
use std::path::PathBuf;

use prehend_geometry::ReadOptions;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::wrong;

/// Options of a robot's file, by name; relative folders are relative to the working directory.
pub(crate) fn read_options(named: Option<&Bound<'_, PyDict>>) -> PyResult<ReadOptions> {
    let mut options = ReadOptions::default();
    for (name, value) in named.into_iter().flatten() {
        match name.extract::<String>()?.as_str() {
            "partial" => options.partial = value.extract()?,
            "root" => options.root = value.extract()?,
            "allow_outside" => options.allow_outside = value.extract()?,
            "packages" => {
                let packages: Option<BTreeMap<String, PathBuf>> = value.extract()?;
                options.packages = packages.unwrap_or_default();
            }
            "inertia_from_geometry" => options.inertia_from_geometry = value.extract()?,
            other => {
                let known = "partial, root, packages, allow_outside, inertia_from_geometry";
                return Err(wrong(format!("there is no option '{other}': options are {known}")));
            }
        }
    }
    Ok(options)
}
