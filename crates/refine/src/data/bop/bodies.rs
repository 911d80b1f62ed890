//! Robots and other bodies beside the object, in `scene_bodies.json` and frame files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Vector3};
use serde::Deserialize;

use super::error::{DatasetError, Origin};
use super::json::{JsonFile, UniqueMap};
use super::numbers::{LengthUnit, NonNegative, Numbers, Real};
use super::pose::{FramePose, Rotation, stated_pose};

/// A body whose shape is known, and its pose as well as is said.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Its name in the dataset.
    pub name: String,
    /// Its shape.
    pub kind: BodyKind,
    /// Joint positions of a hand by name \[rad or m\].
    pub joints: BTreeMap<String, f64>,
    /// Its coordinates (a robot's base link) → camera coordinates \[m\].
    pub t_cam_base: Isometry3<f64>,
    /// Standard deviations of that, in each direction and about each axis \[m, rad\], where they are said.
    pub sigmas: [Option<f64>; 2],
    pub(crate) origin: Origin,
}

/// Shape of a body.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum BodyKind {
    /// A robot hand, or another articulated body.
    Hand {
        /// Its URDF or MJCF file.
        urdf: PathBuf,
    },
    /// The half-space below z = 0 of its own frame.
    Plane,
    /// Another object.
    Object {
        /// Its number in `models/`.
        obj_id: u32,
    },
    /// A rigid body with a mesh of its own.
    Mesh {
        /// Its file.
        file: PathBuf,
        /// Unit of the mesh.
        unit: LengthUnit,
    },
}

impl Body {
    /// Description and joint positions \[rad or m\] of a hand.
    pub fn as_hand(&self) -> Option<(&Path, &BTreeMap<String, f64>)> {
        match &self.kind {
            BodyKind::Hand { urdf } => Some((urdf, &self.joints)),
            BodyKind::Plane | BodyKind::Object { .. } | BodyKind::Mesh { .. } => None,
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
#[serde(deny_unknown_fields)]
struct BodiesEntry {
    gravity: Option<Numbers<3>>,
    bodies: Vec<BodyEntry>,
}

/// A body in a file: of a dataset by `cam_R_b2c` and `cam_t_b2c`, and objects by `obj_id`; of a frame by `pose`, and objects by `mesh`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BodyEntry {
    name: String,
    #[serde(default)]
    kind: BodyKindName,
    #[serde(rename = "cam_R_b2c")]
    rotation: Option<Rotation>,
    #[serde(rename = "cam_t_b2c")]
    translation: Option<Numbers<3>>,
    pose: Option<FramePose>,
    sigma_mm: Option<NonNegative>,
    sigma_deg: Option<NonNegative>,
    urdf: Option<PathBuf>,
    joints: Option<UniqueMap<Real>>,
    obj_id: Option<u32>,
    mesh: Option<PathBuf>,
    mesh_unit: Option<LengthUnit>,
}

/// The name of a kind of body.
#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum BodyKindName {
    #[default]
    Hand,
    Plane,
    Object,
}

/// Standard deviations \[m, rad\] of what is said in millimeters and degrees.
pub(crate) fn sigmas(mm: Option<NonNegative>, deg: Option<NonNegative>) -> [Option<f64>; 2] {
    [mm.map(|mm| mm.0 * 1e-3), deg.map(|deg| deg.0.to_radians())]
}

impl UniqueMap<Real> {
    /// Joint positions by name.
    pub(crate) fn positions(self) -> BTreeMap<String, f64> {
        self.0.into_iter().map(|(name, position)| (name, position.0)).collect()
    }
}

impl BodyEntry {
    /// The body; files are in `folder`.
    ///
    /// # Errors
    /// If a field is missing.
    fn read(self, folder: &Path, origin: Origin) -> Result<Body, DatasetError> {
        let missing = |field: &str| origin.fault(field, "is missing");
        let mut joints = BTreeMap::new();
        let kind = match (self.kind, self.obj_id, self.mesh) {
            (BodyKindName::Hand, ..) => {
                let urdf = folder.join(self.urdf.ok_or_else(|| missing("urdf"))?);
                joints = self.joints.ok_or_else(|| missing("joints"))?.positions();
                BodyKind::Hand { urdf }
            }
            (BodyKindName::Plane, ..) => BodyKind::Plane,
            (BodyKindName::Object, Some(obj_id), _) => BodyKind::Object { obj_id },
            (BodyKindName::Object, None, Some(mesh)) => BodyKind::Mesh {
                file: folder.join(mesh),
                unit: self.mesh_unit.ok_or_else(|| missing("mesh_unit"))?,
            },
            (BodyKindName::Object, None, None) => {
                return Err(missing(if self.pose.is_some() { "mesh" } else { "obj_id" }));
            }
        };
        let t_cam_base = match self.pose {
            Some(pose) => Some(pose.0),
            None => stated_pose(self.rotation, self.translation, "b2c")
                .map_err(|name| missing(&name))?,
        };
        let t_cam_base = t_cam_base.ok_or_else(|| missing("cam_R_b2c"))?;
        let sigmas = sigmas(self.sigma_mm, self.sigma_deg);
        Ok(Body { name: self.name, kind, joints, t_cam_base, sigmas, origin })
    }
}

/// The bodies of `entries`, beside those that there are; files are in `folder`, and entries at `origin` by their indices.
///
/// # Errors
/// If a field is missing, and of a name that is there twice or would be mixed up with those of links.
pub(crate) fn read_bodies(
    bodies: &mut Vec<Body>,
    entries: Vec<BodyEntry>,
    folder: &Path,
    origin: impl Fn(usize) -> Origin,
) -> Result<(), DatasetError> {
    for (k, entry) in entries.into_iter().enumerate() {
        let (name, origin) = (&entry.name, origin(k));
        if name.is_empty() || name.contains('/') {
            return Err(origin.fault("name", format!("{name:?} is empty or has a slash")));
        }
        if bodies.iter().any(|other| other.name == *name) {
            return Err(origin.fault("name", format!("there are two bodies called {name:?}")));
        }
        bodies.push(entry.read(folder, origin)?);
    }
    Ok(())
}

impl SceneBodies {
    /// Reads the entry of image `im_id`; `root` is the folder that paths are relative to.
    pub(super) fn read(file: &JsonFile, im_id: u32, root: &Path) -> Result<Self, DatasetError> {
        let entry: BodiesEntry = file.entry(im_id)?;
        let mut bodies = Vec::with_capacity(entry.bodies.len());
        let origin = |k| Origin::new(file.path(), format!("{im_id}.bodies[{k}]"));
        read_bodies(&mut bodies, entry.bodies, root, origin)?;
        Ok(Self { gravity: entry.gravity.map(|g| g.0.into()), bodies })
    }
}
