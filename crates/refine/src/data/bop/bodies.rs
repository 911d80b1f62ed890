//! Robots and other bodies beside the object, in `scene_bodies.json`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Vector3};
use serde::Deserialize;

use super::error::DatasetError;
use super::json::{JsonFile, Numbers, Real, Rotation};
use super::pose::translation_from_mm;
use crate::data::bodies::check_name;

/// A body whose shape is known, and its pose as well as is said.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Its name in the dataset.
    pub name: String,
    /// What it is.
    pub kind: BodyKind,
    /// Its coordinates (a robot's base link) → camera coordinates \[m\].
    pub t_cam_base: Isometry3<f64>,
    /// Standard deviations of that, in each direction and about each axis \[m, rad\], where they are said.
    pub sigmas: [Option<f64>; 2],
}

/// What a body is.
#[derive(Clone, Debug, PartialEq)]
pub enum BodyKind {
    /// A robot hand, or another articulated body.
    Hand {
        /// Its URDF file.
        urdf: PathBuf,
        /// Joint positions by name \[rad or m\].
        joints: BTreeMap<String, f64>,
    },
    /// The half-space below z = 0 of its own frame.
    Plane,
    /// Another object.
    Object {
        /// Its number in `models/`.
        obj_id: u32,
    },
}

impl Body {
    /// URDF file and joint positions \[rad or m\] of a hand.
    pub fn as_hand(&self) -> Option<(&Path, &BTreeMap<String, f64>)> {
        match &self.kind {
            BodyKind::Hand { urdf, joints } => Some((urdf, joints)),
            BodyKind::Plane | BodyKind::Object { .. } => None,
        }
    }
}

/// One image's entry of `scene_bodies.json`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneBodies {
    /// Gravity in the camera frame \[m/s²\], where it is said.
    pub gravity: Option<Vector3<f64>>,
    /// The bodies in view.
    pub bodies: Vec<Body>,
}

#[derive(Deserialize)]
struct BodiesEntry {
    gravity: Option<Numbers<3>>,
    bodies: Vec<BodyEntry>,
}

/// As the file has it.
#[derive(Deserialize)]
struct BodyEntry {
    name: String,
    #[serde(default)]
    kind: KindName,
    #[serde(rename = "cam_R_b2c")]
    rotation: Rotation,
    #[serde(rename = "cam_t_b2c")]
    translation: Numbers<3>,
    sigma_mm: Option<Real>,
    sigma_deg: Option<Real>,
    urdf: Option<String>,
    joints: Option<BTreeMap<String, Real>>,
    obj_id: Option<u32>,
}

/// The name of a kind of body.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub(crate) enum KindName {
    #[default]
    Hand,
    Plane,
    Object,
}

/// Standard deviations \[m, rad\] of what is said in millimeters and degrees.
///
/// # Errors
/// If one is negative.
pub(crate) fn body_sigmas(mm: Option<Real>, deg: Option<Real>) -> Result<[Option<f64>; 2], String> {
    for (name, sigma) in [("sigma_mm", mm), ("sigma_deg", deg)] {
        if let Some(Real(sigma)) = sigma.filter(|sigma| sigma.0 < 0.0) {
            return Err(format!("{name} is {sigma}, not zero or above"));
        }
    }
    Ok([mm.map(|mm| mm.0 * 1e-3), deg.map(|deg| deg.0.to_radians())])
}

/// Joint positions by name.
pub(crate) fn positions(joints: &BTreeMap<String, Real>) -> BTreeMap<String, f64> {
    joints.iter().map(|(name, position)| (name.clone(), position.0)).collect()
}

/// What is said of a field that is not there, as serde has it.
pub(crate) fn missing(name: &str) -> String {
    format!("missing field `{name}`")
}

impl BodyEntry {
    fn read(self, root: &Path) -> Result<Body, String> {
        let kind = match self.kind {
            KindName::Hand => BodyKind::Hand {
                urdf: root.join(self.urdf.ok_or_else(|| missing("urdf"))?),
                joints: positions(&self.joints.ok_or_else(|| missing("joints"))?),
            },
            KindName::Plane => BodyKind::Plane,
            KindName::Object => {
                BodyKind::Object { obj_id: self.obj_id.ok_or_else(|| missing("obj_id"))? }
            }
        };
        let translation = translation_from_mm(&self.translation.0);
        Ok(Body {
            name: self.name,
            kind,
            t_cam_base: Isometry3::from_parts(translation, self.rotation.0),
            sigmas: body_sigmas(self.sigma_mm, self.sigma_deg)?,
        })
    }
}

impl SceneBodies {
    /// Reads the entry of image `im_id`; `root` is the folder that URDF paths are relative to.
    pub(super) fn read(file: &JsonFile, im_id: u32, root: &Path) -> Result<Self, DatasetError> {
        let BodiesEntry { gravity, bodies } = file.entry(im_id)?;
        let mut read: Vec<Body> = Vec::with_capacity(bodies.len());
        for (k, entry) in bodies.into_iter().enumerate() {
            let fault = |problem: &str| file.fault(&format!("{im_id}.bodies[{k}]"), problem);
            check_name(&entry.name).map_err(|problem| fault(&problem))?;
            let body = entry.read(root).map_err(|problem| fault(&problem))?;
            if read.iter().any(|other| other.name == body.name) {
                return Err(fault(&format!("there are two bodies called {:?}", body.name)));
            }
            read.push(body);
        }
        Ok(Self { gravity: gravity.map(|g| g.0.into()), bodies: read })
    }

    /// The body called `name`.
    pub fn body(&self, name: &str) -> Option<&Body> {
        self.bodies.iter().find(|b| b.name == name)
    }
}
