//! Writes `models_info.json`.

use nalgebra::{Isometry3, Point3};
use prehend_geometry::cloud::diameter;
use serde_json::{Map, Value, json};

use super::error::DatasetError;
use super::files::write_atomically;
use super::json::{UniqueMap, read_json};
use super::models::Models;
use super::pose::{rotation_to_row_major, translation_to_mm};
use crate::MM_PER_M;
use crate::symmetry::{ContinuousSymmetry, Symmetries};

/// Diameter and bounds of a model of these `vertices` \[m\], as `models_info.json` has them, in millimeters.
pub(crate) fn extent_to_bop(vertices: &[Point3<f64>]) -> Map<String, Value> {
    let first = vertices.first().copied().unwrap_or_default();
    let (low, high) =
        vertices.iter().fold((first, first), |(low, high), v| (low.inf(v), high.sup(v)));
    let mut fields = Map::new();
    fields.insert("diameter".into(), json!(diameter(vertices) * MM_PER_M));
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        fields.insert(format!("min_{name}"), json!(low[axis] * MM_PER_M));
        fields.insert(format!("size_{name}"), json!((high[axis] - low[axis]) * MM_PER_M));
    }
    fields
}

/// Writes the symmetries of object `obj_id`, of these `vertices` \[m\], into the folder's `models_info.json`, in place of
/// those that were there. Everything else in the file stays; an object that it lacks, and a file that is absent, begin with
/// diameter and bounds.
///
/// # Errors
/// When the file is broken or cannot be written; it is then as it was.
pub fn write_symmetries(
    models: &Models,
    obj_id: u32,
    vertices: &[Point3<f64>],
    symmetries: &Symmetries,
) -> Result<(), DatasetError> {
    let file = models.dir().join("models_info.json");
    // Strictly: numbers that JSON does not know could not be written back.
    let mut list: UniqueMap<Map<String, Value>> = match read_json(&file) {
        Err(DatasetError::Missing { .. }) => UniqueMap::default(),
        read => read?,
    };
    let fields = list.0.entry(obj_id.to_string()).or_insert_with(|| extent_to_bop(vertices));
    for name in ["symmetries_discrete", "symmetries_continuous"] {
        fields.remove(name);
    }
    fields.extend(symmetries.to_bop());
    write_atomically(&file, format!("{:#}\n", json!(list.0)).as_bytes())
}

impl Symmetries {
    /// As `models_info.json` has them: `symmetries_discrete` and `symmetries_continuous`, in millimeters; what there is
    /// none of is left out.
    pub(super) fn to_bop(&self) -> Map<String, Value> {
        let motion = |m: &Isometry3<f64>| {
            let [r, t] = [
                rotation_to_row_major(&m.rotation).to_vec(),
                translation_to_mm(&m.translation).to_vec(),
            ];
            let rows = r.chunks(3).zip(&t).flat_map(|(row, t)| [row[0], row[1], row[2], *t]);
            rows.chain([0.0, 0.0, 0.0, 1.0]).collect::<Vec<f64>>()
        };
        let axis = |c: &ContinuousSymmetry| json!({ "axis": c.axis.as_slice(), "offset": (c.point.coords * MM_PER_M).as_slice() });
        let mut fields = Map::new();
        if !self.discrete.is_empty() {
            fields.insert("symmetries_discrete".into(), self.discrete.iter().map(motion).collect());
        }
        if !self.continuous.is_empty() {
            let axes: Vec<Value> = self.continuous.iter().map(axis).collect();
            fields.insert("symmetries_continuous".into(), axes.into());
        }
        fields
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn other_objects_and_fields_stay_and_absent_ones_begin() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("models_info.json");
        let flip = Isometry3::rotation(nalgebra::Vector3::z() * std::f64::consts::PI);
        let symmetries = Symmetries { discrete: vec![flip], ..Symmetries::default() };
        let vertices = [[0.0, 0.0, 0.0], [0.03, 0.04, 0.0]].map(Point3::from);
        let models = || Models::new(dir.path().to_path_buf());
        fs::write(&file, r#"{"1": {"diameter": 7.5, "mass_kg": 2, "symmetries_continuous": [1]}}"#)
            .unwrap();
        for id in [1, 2] {
            write_symmetries(&models(), id, &vertices, &symmetries).unwrap();
        }
        let (kept, begun) = (models().info(1).unwrap(), models().info(2).unwrap());
        assert_eq!((kept.diameter, kept.mass), (0.0075, Some(2.0)));
        assert_eq!(begun.diameter, 0.05);
        for info in [kept, begun] {
            assert_eq!((info.symmetries.discrete.len(), info.symmetries.continuous.len()), (1, 0));
        }
        fs::write(&file, r#"{"1": {"diameter": NaN}}"#).unwrap();
        let error = write_symmetries(&models(), 1, &vertices, &symmetries).unwrap_err();
        assert!(error.to_string().contains("models_info.json: not valid JSON"), "{error}");
        assert_eq!(fs::read(&file).unwrap(), br#"{"1": {"diameter": NaN}}"#);
    }
}
