//! Kind, content and faults of a file or folder, without using it.
//!
//! [`describe`] tells meshes, robots, datasets, frame files, rigs, poses and images apart, reads them as everything else here does, and returns
//! a [`Description`] that prints as aligned lines and serializes as a JSON object.

mod dataset;
mod detect;
mod frame;
mod image;
mod mesh;
mod poses;
mod rig;
mod robot;
mod text;

use std::fmt;
use std::path::{Path, PathBuf};

use prehend_geometry::ReadOptions;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::data::AssetError;

/// How a thing is read that does not say so itself.
#[derive(Clone, Debug)]
pub struct DescribeOptions {
    /// Meters of one unit of a mesh.
    pub mesh_unit: f64,
    /// Density \[kg/m³\] of a mesh whose mass properties are wanted.
    pub density: Option<f64>,
    /// Split of a dataset; `test` or the only one without.
    pub split: Option<String>,
    /// Options of the reader of robots.
    pub robot: ReadOptions,
}

impl Default for DescribeOptions {
    fn default() -> Self {
        Self { mesh_unit: 1.0, density: None, split: None, robot: ReadOptions::default() }
    }
}

/// Content of a path. Prints as a summary, by `{:#}` with all rows of its tables, of which a robot's summary has none.
#[derive(Clone, Debug, Serialize)]
pub struct Description {
    /// The path described.
    pub path: PathBuf,
    /// `mesh`, `robot`, `dataset`, `frame`, `rig`, `poses` or `image`.
    pub kind: &'static str,
    /// Fields by name, in SI units unless the name has another.
    #[serde(flatten)]
    pub fields: Map<String, Value>,
    /// Faults, and parts that were not read.
    pub warnings: Vec<String>,
}

/// Describes what is at `path`.
///
/// # Errors
/// [`AssetError`], naming the file: if there is nothing, or nothing that is known, or it is broken.
pub fn describe(path: &Path, options: &DescribeOptions) -> Result<Description, AssetError> {
    let mut warnings = Vec::new();
    let (kind, value) = detect::read(path, options, &mut warnings)?;
    let fields = match value {
        Value::Object(fields) => fields,
        other => Map::from_iter([("content".to_owned(), other)]),
    };
    Ok(Description { path: path.into(), kind, fields, warnings })
}

/// Rows of a table that fit a screen beside the summary.
const ROWS: usize = 24;

impl fmt::Display for Description {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}: {}", self.path.display(), self.kind)?;
        let rows = match (f.alternate(), self.kind) {
            (true, _) => usize::MAX,
            (false, "robot") => 0,
            (false, _) => ROWS,
        };
        text::write_fields(f, &self.fields, 1, rows)
    }
}
