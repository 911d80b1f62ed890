//! The settings of a dataset, kept beside it in `synth.json`, and the random sequences that follow from its seed.

use std::fs;
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::Path;

use prehend_geometry::{SplitMix64, TriMesh};
use prehend_render::{Camera, Distortion};
use serde::{Serialize, Serializer};
use serde_json::{Map, Value, json};

use super::annotation;
use super::error::SynthError;
use super::hand_files::HandFiles;
use super::sensor::{FilmSettings, SensorSettings};
use crate::data::bop::{DatasetError, present, read_json, write_atomically};
use crate::data::identity::{fingerprint, program};
use crate::scene::Object;

/// An object of a dataset in the making.
pub struct SynthObject {
    /// Its number among the models, and that of its scene.
    pub obj_id: u32,
    /// The object as it truly is.
    pub object: Object,
}

/// Settings of a dataset.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SynthSettings {
    /// Frames of each object.
    pub frames: NonZeroU32,
    /// Frames of each grasp, spread evenly over its moments.
    pub frames_per_grasp: NonZeroU32,
    /// Columns of the images.
    pub width: NonZeroUsize,
    /// Rows of the images.
    pub height: NonZeroUsize,
    /// The camera's lens, if it is no pinhole.
    #[serde(serialize_with = "lens")]
    pub lens: Option<Distortion>,
    /// True if the dataset keeps silent about that lens, as about other faults of a rig.
    pub undeclared_lens: bool,
    /// A film of each grasp: the camera stands still, and the frames follow each other in time.
    pub film: Option<FilmSettings>,
    /// Sensor models.
    pub sensor: SensorSettings,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Settings of the grasp generator: only stored and compared.
    pub grasp: Value,
}

impl SynthSettings {
    /// The camera without its lens.
    pub(super) fn camera(&self) -> Camera {
        self.sensor.viewpoint.camera(self.width.get(), self.height.get())
    }
}

/// Writes the plan to `dir`, or makes sure that it is the one which is there.
///
/// # Errors
/// [`SynthError::Refused`] if other settings or other files are there; or when the file cannot be read or written.
pub(super) fn check_plan(
    dir: &Path,
    hand: &HandFiles,
    subjects: &[SynthObject],
    settings: &SynthSettings,
) -> Result<(), SynthError> {
    let plan = describe(hand, subjects, settings);
    let file = dir.join("synth.json");
    if let Some(stored) = present(read_json::<Value>(&file))? {
        return match difference(&stored, &plan, "") {
            None => Ok(()),
            Some(difference) => Err(SynthError::refused(format!(
                "{}: {difference}: give the same settings, or another folder",
                file.display()
            ))),
        };
    }
    let mut entries = fs::read_dir(dir).map_err(|e| DatasetError::reading(dir, &e))?;
    // A run that ended before it had a plan may have left a temporary file.
    if entries.any(|e| e.is_ok_and(|e| !e.file_name().to_string_lossy().starts_with(".synth.json")))
    {
        return Err(SynthError::refused(format!(
            "{}: is not empty and has no synth.json: no dataset of ours to go on with",
            dir.display()
        )));
    }
    Ok(write_atomically(&file, format!("{plan:#}\n").as_bytes())?)
}

fn describe(hand: &HandFiles, subjects: &[SynthObject], settings: &SynthSettings) -> Value {
    let object = |s: &SynthObject| {
        let told = json!({
            "name": s.object.name,
            "mass_kg": s.object.inertial.mass,
            "mesh": fingerprint(&mesh_bytes(&s.object.mesh).collect::<Vec<u8>>()),
        });
        (s.obj_id.to_string(), told)
    };
    let mut plan = json!(settings);
    plan["program"] = json!(program());
    plan["hand"] = json!(fingerprint(&hand.content().collect::<Vec<u8>>()));
    plan["objects"] = subjects.iter().map(object).collect::<Map<String, Value>>().into();
    plan
}

/// A lens, as `cam_dist` of a camera has it.
fn lens<S: Serializer>(lens: &Option<Distortion>, serializer: S) -> Result<S::Ok, S::Error> {
    lens.as_ref().map(annotation::lens).serialize(serializer)
}

/// The first place where two plans differ, and what they say there.
fn difference(stored: &Value, given: &Value, place: &str) -> Option<String> {
    let (Value::Object(old), Value::Object(new)) = (stored, given) else {
        // Through text, as the stored one came: whole numbers and fractions may be of different types.
        let (stored, given) = (stored.to_string(), given.to_string());
        return (stored != given).then(|| {
            format!("{place} was {stored} when this dataset was begun, and now is {given}")
        });
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

/// Purpose of a random sequence: each purpose has a sequence of its own, so that none depends on how many numbers another uses.
#[derive(Clone, Copy, Debug)]
pub(super) enum FrameUse {
    /// The object model that the estimator is given, by object.
    Model = 1,
    /// The grasp and its trajectory, by object and grasp.
    Grasp,
    /// Sensor faults that last, by object and grasp, or of all.
    Rig,
    /// Errors that differ from frame to frame, by object and frame.
    Frame,
    /// Initial poses of the lower level, by object and frame.
    InitialLow,
    /// Initial poses of the higher level, by object and frame.
    InitialHigh,
    /// The camera of a film and what passes in front of it, by object and grasp.
    Film,
}

/// A seed for one `purpose`, one object and one number.
pub(super) fn seed(seed: u64, purpose: FrameUse, obj_id: u32, number: u32) -> u64 {
    // The finalizer of SplitMix64 after each word, so that near words give unrelated seeds.
    let words = [seed, purpose as u64, u64::from(obj_id), u64::from(number)];
    words.into_iter().fold(0_u64, |state, word| {
        let mut z = (state ^ word).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}

/// The sequence of [`seed`].
pub(super) fn sequence(from: u64, purpose: FrameUse, obj_id: u32, number: u32) -> SplitMix64 {
    SplitMix64::new(seed(from, purpose, obj_id, number))
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
        assert_eq!(found, "b.c was 0.5 when this dataset was begun, and now is 0.25");
        let less = json!({"a": 1, "b": {"c": 0.5}});
        assert!(difference(&old, &less, "").unwrap().starts_with("b.d was 2 "));
        assert!(difference(&less, &old, "").unwrap().starts_with("b.d was null "));
    }

    #[test]
    fn seeds_differ_in_every_argument() {
        let mut seen = std::collections::BTreeSet::new();
        for from in 0..4 {
            for purpose in [
                FrameUse::Model,
                FrameUse::Grasp,
                FrameUse::Rig,
                FrameUse::Frame,
                FrameUse::InitialHigh,
            ] {
                for obj_id in 1..10 {
                    (0..50).for_each(|n| assert!(seen.insert(seed(from, purpose, obj_id, n))));
                }
            }
        }
    }
}
