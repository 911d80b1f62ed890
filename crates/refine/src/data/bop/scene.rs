//! What an estimator may know about one image beside its pixels: robot and touch.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Vector3};
use serde::Deserialize;

use super::error::DatasetError;
use super::json::{JsonFile, Numbers, Rotation};
use super::pose::translation_from_mm;

/// Force units of `scene_tactile.json` per newton.
pub const UNITS_PER_NEWTON: f64 = 1000.0;

/// A robot (or other articulated body) whose shape, pose and joint angles are known.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Its name in the dataset.
    pub name: String,
    /// Its URDF file.
    pub urdf: PathBuf,
    /// Base link coordinates → camera coordinates \[m\].
    pub t_cam_base: Isometry3<f64>,
    /// Joint positions by name \[rad or m\].
    pub joints: BTreeMap<String, f64>,
}

/// One image's entry of `scene_bodies.json`.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneBodies {
    /// Gravity in the camera frame \[m/s²\].
    pub gravity: Vector3<f64>,
    /// The bodies in view.
    pub bodies: Vec<Body>,
}

#[derive(Deserialize)]
struct BodiesEntry {
    gravity: Numbers<3>,
    bodies: Vec<BodyEntry>,
}

#[derive(Deserialize)]
struct BodyEntry {
    name: String,
    urdf: String,
    #[serde(rename = "cam_R_b2c")]
    rotation: Rotation,
    #[serde(rename = "cam_t_b2c")]
    translation: Numbers<3>,
    joints: BTreeMap<String, f64>,
}

impl SceneBodies {
    /// Reads the entry of image `im_id`; `root` is the folder that URDF paths are relative to.
    pub(super) fn read(file: &JsonFile, im_id: u32, root: &Path) -> Result<Self, DatasetError> {
        let BodiesEntry { gravity, bodies } = file.entry(im_id)?;
        let body = |entry: BodyEntry| Body {
            name: entry.name,
            urdf: root.join(entry.urdf),
            t_cam_base: Isometry3::from_parts(
                translation_from_mm(&entry.translation.0),
                entry.rotation.0,
            ),
            joints: entry.joints,
        };
        Ok(Self { gravity: gravity.0.into(), bodies: bodies.into_iter().map(body).collect() })
    }

    /// The body called `name`.
    pub fn body(&self, name: &str) -> Option<&Body> {
        self.bodies.iter().find(|b| b.name == name)
    }
}

/// One image's entry of `scene_tactile.json`: the taxel forces of one body.
#[derive(Clone, Debug, PartialEq)]
pub struct Tactile {
    /// Name of the body that carries the taxels.
    pub body: String,
    /// The table of taxel positions (see [`prehend_geometry::hand::load_taxels`]), in the order of `force`.
    pub taxels: PathBuf,
    /// Force of the object on the hand at each taxel, in the frame of the taxel's link \[N\].
    pub force: Vec<Vector3<f64>>,
}

#[derive(Deserialize)]
struct TactileEntry {
    body: String,
    taxels: String,
    force: Vec<Numbers<3>>,
}

impl Tactile {
    /// Reads the entry of image `im_id`; `root` is the folder that the taxel table's path is relative to.
    pub(super) fn read(file: &JsonFile, im_id: u32, root: &Path) -> Result<Self, DatasetError> {
        let TactileEntry { body, taxels, force } = file.entry(im_id)?;
        let force = force.into_iter().map(|f| Vector3::from(f.0) / UNITS_PER_NEWTON).collect();
        Ok(Self { body, taxels: root.join(taxels), force })
    }
}
