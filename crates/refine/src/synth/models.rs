//! The models of a dataset.

use std::collections::BTreeMap;
use std::path::Path;

use prehend_geometry::TriMesh;
use serde_json::{Map, Value};

use super::annotation;
use super::folder::make;
use crate::data::AssetError;
use crate::data::bop::write_atomically;
use crate::scene::Inertial;

/// Writes `obj_*.ply` in millimeters, with textures beside them, and `models_info.json` to the folder `dir`.
///
/// # Errors
/// When a file cannot be written.
pub(super) fn write_models(
    dir: &Path,
    models: &BTreeMap<u32, (TriMesh, &Inertial)>,
) -> Result<(), AssetError> {
    make(dir)?;
    let mut info = Map::new();
    for (id, (mesh, inertial)) in models {
        mesh.clone().scaled(1e3).save_ply(&dir.join(format!("obj_{id:06}.ply")))?;
        info.insert(id.to_string(), annotation::model(mesh, inertial));
    }
    let text = format!("{:#}\n", Value::Object(info));
    Ok(write_atomically(&dir.join("models_info.json"), text.as_bytes())?)
}
