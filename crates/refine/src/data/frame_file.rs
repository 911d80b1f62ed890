//! One frame described by a JSON file: images, mesh, pose and, where known, the hand.
//!
//! Every length names its unit and every quaternion its order, because guessing them is how poses get
//! lost. `docs/FRAME.md` describes the format; paths are relative to the file's folder.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use prehend_geometry::hand::{Taxel, load_taxels};
use prehend_geometry::robot::KinematicTree;
use prehend_geometry::{GridCache, TriMesh};
use prehend_render::{Camera, DepthImage, Mask, Remap, RgbImage};
use serde::Deserialize;

use crate::data::assets::FrameInput;
use crate::data::bop::{DatasetError, Lens, Numbers, Positive, read_json};
use crate::data::pose::pose_from_matrix;
use crate::rig::Rig;
use crate::scene::{Hand, HandMeasurement, Object, Observation, check_gravity};

/// Reads the frame file `file` and everything it names: the frame, and the initial pose (object → camera \[m\]). `seed` decides
/// where the object's surface is sampled; distance grids of the hand are kept in `cache`. With a `rig` the frame is corrected by it, and the
/// object, too, if the file says which of the rig's it is.
///
/// # Errors
/// If the file or one that it names is missing or broken, or does not fit the rig, naming the file and the field.
pub fn load_frame_file(
    file: &Path,
    seed: u64,
    cache: Option<&GridCache>,
    rig: Option<Arc<Rig>>,
) -> Result<(FrameInput, Isometry3<f64>), DatasetError> {
    let fault = |problem: &dyn Display| DatasetError::unusable(file, problem);
    let FrameParts { mut observation, mesh, mesh_file, robot, layout } = FrameParts::read(file)?;
    let name = mesh_file.display().to_string();
    let mut object = Object::with_mass(&name, mesh, layout.mass_kg, seed).map_err(|e| fault(&e))?;
    if let (Some(rig), Some(id)) = (&rig, layout.obj_id) {
        match rig.corrected_object(id, &object).map_err(|e| fault(&e))? {
            Some(corrected) => object = corrected,
            // As of a dataset: other objects are seen by the same rig.
            None => log::info!("the rig does not know object {id}"),
        }
    }
    let hand = robot.map(|(tree, skin)| Hand::cached(tree, skin, cache)).transpose();
    let hand = hand.map_err(|e| fault(&e))?.map(Arc::new);
    if let Some(Lens(lens)) = &layout.lens {
        let camera = observation.camera;
        let remap = Remap::undistort(camera, lens, camera);
        observation.undistort(&remap).map_err(|e| fault(&e))?;
    }
    if let Some(rig) = &rig {
        observation = rig.corrected(&observation).map_err(|e| fault(&e))?;
    }
    Ok((FrameInput { observation, object: Arc::new(object), hand, rig }, layout.pose.0))
}

/// What a frame file names, as it is there: nothing is derived from it yet.
pub(crate) struct FrameParts {
    /// Images as they were taken, and what is measured of the hand.
    pub(crate) observation: Observation,
    /// The object's mesh \[m\].
    pub(crate) mesh: TriMesh,
    pub(crate) mesh_file: PathBuf,
    /// The hand and its taxels.
    pub(crate) robot: Option<(KinematicTree, Vec<Taxel>)>,
    layout: Layout,
}

impl FrameParts {
    /// Reads the frame file `file` and everything it names.
    ///
    /// # Errors
    /// If the file or one that it names is missing or broken, naming the file and the field.
    pub(crate) fn read(file: &Path) -> Result<Self, DatasetError> {
        let fault = |problem: &dyn Display| DatasetError::unusable(file, problem);
        let field = |name: &str, problem: &dyn Display| DatasetError::field(file, name, problem);
        let layout: Layout = read_json(file)?;
        let folder = file.parent().unwrap_or(Path::new("."));
        let color = RgbImage::load(&folder.join(&layout.rgb)).map_err(|e| fault(&e))?;
        let depth = DepthImage::load(&folder.join(&layout.depth), layout.depth_unit_m.0)
            .map_err(|e| fault(&e))?;
        let mask = Mask::load(&folder.join(&layout.mask)).map_err(|e| fault(&e))?;
        let (w, h) = (color.width(), color.height());
        let camera = Camera::from_k(layout.k.0, w, h).map_err(|e| field("K", &e))?;
        for (name, width, height) in
            [("depth", depth.width(), depth.height()), ("mask", mask.width(), mask.height())]
        {
            if (width, height) != (w, h) {
                let problem = format!("the image is {width}x{height} pixels, rgb is {w}x{h}");
                return Err(field(name, &problem));
            }
        }
        let mesh_file = folder.join(&layout.mesh);
        let mesh = TriMesh::load(&mesh_file).map_err(|e| fault(&e))?;
        let mesh = mesh.scaled(layout.mesh_unit.meters());
        let (mut robot, mut measured) = (None, None);
        if let Some(r) = &layout.robot {
            let tree =
                KinematicTree::from_urdf_file(folder.join(&r.urdf)).map_err(|e| fault(&e))?;
            let joints = tree.joint_vector(&r.joints).map_err(|e| field("robot.joints", &e))?;
            let skin = r.taxels.as_ref().map(|csv| load_taxels(&folder.join(csv))).transpose();
            let skin = skin.map_err(|e| fault(&e))?.unwrap_or_default();
            let forces = r.forces.as_deref().unwrap_or_default();
            if !forces.is_empty() && forces.len() != skin.len() {
                let (expected, found) = (skin.len(), forces.len());
                let problem =
                    format!("expected one force for each of {expected} taxels, found {found}");
                return Err(field("robot.forces", &problem));
            }
            let forces = forces.iter().map(|f| Vector3::from(f.0)).collect();
            measured = Some(HandMeasurement { t_cam_hand: r.base_pose.0, joints, forces });
            robot = Some((tree, skin));
        }
        let gravity = layout.gravity.as_ref().map(|g| Vector3::from(g.0));
        gravity.iter().try_for_each(check_gravity).map_err(|e| field("gravity", &e))?;
        let observation = Observation { camera, color, depth, mask, gravity, hand: measured };
        Ok(Self { observation, mesh, mesh_file, robot, layout })
    }

    /// The initial pose, object → camera \[m\].
    pub(crate) fn t_cam_object(&self) -> &Isometry3<f64> {
        &self.layout.pose.0
    }

    /// Mass of the object \[kg\], where the file says it.
    pub(crate) fn mass(&self) -> Option<f64> {
        self.layout.mass_kg
    }

    /// Whether the images were taken through a lens.
    pub(crate) fn has_lens(&self) -> bool {
        self.layout.lens.is_some()
    }
}

/// The file's layout.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Layout {
    /// Row-major 3×3 intrinsics \[px\].
    #[serde(rename = "K")]
    k: Numbers<9>,
    /// Through which the images were taken.
    #[serde(rename = "dist")]
    lens: Option<Lens>,
    rgb: PathBuf,
    depth: PathBuf,
    /// Meters of one unit of the depth image.
    depth_unit_m: Positive,
    mask: PathBuf,
    mesh: PathBuf,
    mesh_unit: Unit,
    mass_kg: Option<f64>,
    /// The object's number in a rig.
    obj_id: Option<u32>,
    pose: Pose,
    gravity: Option<Numbers<3>>,
    robot: Option<RobotLayout>,
}

#[derive(Clone, Copy, Deserialize)]
enum Unit {
    #[serde(rename = "m")]
    Meter,
    #[serde(rename = "mm")]
    Millimeter,
}

impl Unit {
    fn meters(self) -> f64 {
        match self {
            Self::Meter => 1.0,
            Self::Millimeter => 1e-3,
        }
    }
}

/// A pose into the camera frame \[m\].
#[derive(Deserialize)]
#[serde(try_from = "PoseLayout")]
struct Pose(Isometry3<f64>);

/// A 4×4 matrix, or a quaternion whose name says its order.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PoseLayout {
    unit: Unit,
    matrix: Option<Numbers<16>>,
    quaternion_wxyz: Option<Numbers<4>>,
    quaternion_xyzw: Option<Numbers<4>>,
    translation: Option<Numbers<3>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotLayout {
    urdf: PathBuf,
    base_pose: Pose,
    joints: BTreeMap<String, f64>,
    taxels: Option<PathBuf>,
    /// Force of the object on each taxel, in its link's frame \[N\].
    forces: Option<Vec<Numbers<3>>>,
}

impl TryFrom<PoseLayout> for Pose {
    type Error = String;

    fn try_from(layout: PoseLayout) -> Result<Self, String> {
        let from_quaternion = |[w, x, y, z]: [f64; 4]| {
            let q = Quaternion::new(w, x, y, z);
            let norm = q.norm();
            if (norm - 1.0).abs() > 1e-3 {
                return Err(format!("the quaternion has norm {norm}, not 1"));
            }
            let translation = layout.translation.ok_or("a quaternion needs a translation")?;
            Ok((UnitQuaternion::new_normalize(q), translation.0))
        };
        let (rotation, translation) =
            match (layout.matrix, layout.quaternion_wxyz, layout.quaternion_xyzw) {
                (Some(m), None, None) => {
                    let pose = pose_from_matrix(&m.0)?;
                    (pose.rotation, pose.translation.vector.into())
                }
                (None, Some(wxyz), None) => from_quaternion(wxyz.0)?,
                (None, None, Some(Numbers([x, y, z, w]))) => from_quaternion([w, x, y, z])?,
                _ => {
                    return Err(
                        "give exactly one of matrix, quaternion_wxyz and quaternion_xyzw".into()
                    );
                }
            };
        let translation = Vector3::from(translation) * layout.unit.meters();
        Ok(Self(Isometry3::from_parts(translation.into(), rotation)))
    }
}
