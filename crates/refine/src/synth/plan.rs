//! What a dataset is made of, kept beside it.

use std::fs;
use std::path::Path;

use prehend_geometry::TriMesh;
use serde_json::{Map, Value, json};

use super::folder::fault;
use super::hand_files::HandFiles;
use super::{SensorSettings, SynthError};
use crate::data::bop::{DatasetError, write_atomically};
use crate::data::identity::{fingerprint, program};
use crate::scene::Object;

/// An object of a dataset in the making.
pub struct Subject {
    /// Its number among the models, and that of its scene.
    pub obj_id: u32,
    /// The object as it truly is.
    pub object: Object,
}

/// How many frames to make, and with what.
#[derive(Clone, Debug, PartialEq)]
pub struct SynthSettings {
    /// Frames of each object.
    pub frames: u32,
    /// Frames of each grasp, spread evenly over its moments.
    pub frames_per_grasp: u32,
    /// Columns of the images.
    pub width: usize,
    /// Rows of the images.
    pub height: usize,
    /// What the sensors are like.
    pub sensor: SensorSettings,
    /// Decides everything that is random.
    pub seed: u64,
    /// Settings of whatever makes the grasps: not looked at, only kept and compared.
    pub grasp: Value,
}

impl Default for SynthSettings {
    /// 40 frames of 640 × 480 pixels, four a grasp, from clean sensors.
    fn default() -> Self {
        Self {
            frames: 40,
            frames_per_grasp: 4,
            width: 640,
            height: 480,
            sensor: SensorSettings::clean(),
            seed: 0,
            grasp: Value::Null,
        }
    }
}

const FILE: &str = "synth.json";

/// Writes the plan to `dir`, or makes sure that it is the one which is there.
///
/// # Errors
/// [`SynthError::OtherSettings`], [`SynthError::Occupied`], or when the file cannot be read or written.
pub(super) fn settle(
    dir: &Path,
    hand: &HandFiles,
    subjects: &[Subject],
    settings: &SynthSettings,
) -> Result<(), SynthError> {
    let plan = describe(hand, subjects, settings);
    let file = dir.join(FILE);
    if file.is_file() {
        let bytes = fs::read(&file).map_err(|e| DatasetError::reading(&file, &e))?;
        let stored: Value =
            serde_json::from_slice(&bytes).map_err(|e| DatasetError::malformed(&file, e))?;
        return match difference(&stored, &plan, "") {
            None => Ok(()),
            Some((setting, stored, given)) => {
                Err(SynthError::OtherSettings { file, setting, stored, given })
            }
        };
    }
    let mut entries = fs::read_dir(dir).map_err(|e| fault(dir, &e))?;
    // A run that ended before it had a plan may have left a temporary file.
    if entries.any(|e| e.is_ok_and(|e| !e.file_name().to_string_lossy().starts_with(".synth.json")))
    {
        return Err(SynthError::Occupied { dir: dir.to_owned() });
    }
    Ok(write_atomically(&file, format!("{plan:#}\n").as_bytes())?)
}

fn describe(hand: &HandFiles, subjects: &[Subject], settings: &SynthSettings) -> Value {
    let object = |s: &Subject| {
        let told = json!({
            "name": s.object.name,
            "mass_kg": s.object.inertial.mass,
            "mesh": fingerprint(&mesh_bytes(&s.object.mesh).collect::<Vec<u8>>()),
        });
        (s.obj_id.to_string(), told)
    };
    let SynthSettings { frames, frames_per_grasp, width, height, sensor, seed, grasp } = settings;
    json!({
        "program": program(),
        "frames": frames,
        "frames_per_grasp": frames_per_grasp,
        "width": width,
        "height": height,
        "seed": seed,
        "sensor": sensor.to_json(),
        "grasp": grasp,
        "hand": fingerprint(&hand.content().collect::<Vec<u8>>()),
        "objects": subjects.iter().map(object).collect::<Map<String, Value>>(),
    })
}

/// The first place where two plans differ, and what they say there.
fn difference(stored: &Value, given: &Value, place: &str) -> Option<(String, String, String)> {
    let (Value::Object(old), Value::Object(new)) = (stored, given) else {
        // Through text, as the stored one came: whole numbers and fractions may be of different types.
        let (stored, given) = (stored.to_string(), given.to_string());
        return (stored != given).then(|| (place.to_owned(), stored, given));
    };
    let names = old.keys().chain(new.keys().filter(|name| !old.contains_key(*name)));
    names.into_iter().find_map(|name| {
        let inner = if place.is_empty() { name.clone() } else { format!("{place}.{name}") };
        let of = |map: &Map<String, Value>| map.get(name).cloned().unwrap_or_default();
        difference(&of(old), &of(new), &inner)
    })
}

fn mesh_bytes(mesh: &TriMesh) -> impl Iterator<Item = u8> + '_ {
    let places = mesh.vertices.iter().flat_map(|v| [v.x, v.y, v.z]).flat_map(f64::to_le_bytes);
    let faces = mesh.faces.iter().flatten().flat_map(|v| v.to_le_bytes());
    let uvs = mesh.uvs.iter().flatten().flatten().flat_map(|v| v.to_le_bytes());
    let texels = mesh.texture.iter().flat_map(|t| t.pixels.iter().flatten().copied());
    places.chain(faces).chain(uvs).chain(texels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_difference_is_named() {
        let old = json!({"a": 1, "b": {"c": 0.5, "d": 2}});
        assert_eq!(difference(&old, &old.clone(), ""), None);
        let new = json!({"a": 1, "b": {"c": 0.25, "d": 2}});
        let found = difference(&old, &new, "").unwrap();
        assert_eq!(found, ("b.c".to_owned(), "0.5".to_owned(), "0.25".to_owned()));
        let less = json!({"a": 1, "b": {"c": 0.5}});
        assert_eq!(difference(&old, &less, "").unwrap().0, "b.d");
        assert_eq!(difference(&less, &old, "").unwrap().1, "null");
    }
}
