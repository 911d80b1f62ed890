//! One frame described by a JSON file: images, mesh, pose and, where known, the hand.
//!
//! Every length names its unit and every quaternion its order, because guessing them is how poses get
//! lost. `docs/FRAME.md` describes the format; paths are relative to the file's folder.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};
use prehend_geometry::hand::{Taxel, load_taxels};
use prehend_geometry::robot::KinematicTree;
use prehend_geometry::{GridCache, TriMesh};
use prehend_render::{Camera, DepthImage, Mask, RgbImage};
use serde::Deserialize;

use crate::data::bop::{DatasetError, rotation_from_row_major};
use crate::scene::check_gravity;
use crate::scene::{Hand, HandMeasurement, Object, Observation};
use crate::strategy::GradientKind;

/// A frame ready to be refined.
pub struct FrameInput {
    /// What was sensed.
    pub observation: Observation,
    /// The object.
    pub object: Object,
    /// The hand, if the file describes one.
    pub robot: Option<Arc<Hand>>,
    /// The initial pose, object → camera \[m\].
    pub t_cam_object: Isometry3<f64>,
}

impl FrameInput {
    /// Reads the frame file `file` and everything it names; distance grids of the robot are kept in `cache`.
    ///
    /// # Errors
    /// If the file or one that it names is missing or broken, naming the file and the field.
    pub fn load(file: &Path, seed: u64, cache: Option<&GridCache>) -> Result<Self, DatasetError> {
        let fault = |problem: &dyn std::fmt::Display| DatasetError::malformed(file, problem);
        let field = |field: &str, problem: String| DatasetError::Field {
            file: file.into(),
            field: field.into(),
            problem,
        };
        let text = std::fs::read_to_string(file).map_err(|e| fault(&e))?;
        let layout: Layout = serde_json::from_str(&text).map_err(|e| fault(&e))?;
        let folder = file.parent().unwrap_or(Path::new("."));

        if !(layout.depth_unit_m.is_finite() && layout.depth_unit_m > 0.0) {
            return Err(field("depth_unit_m", "must be a positive number of meters".into()));
        }
        let color = RgbImage::load(&folder.join(&layout.rgb)).map_err(|e| fault(&e))?;
        let depth = DepthImage::load(&folder.join(&layout.depth), layout.depth_unit_m)
            .map_err(|e| fault(&e))?;
        let mask = Mask::load(&folder.join(&layout.mask)).map_err(|e| fault(&e))?;
        let camera = Camera::from_k(layout.k, color.width(), color.height())
            .map_err(|e| field("K", e.to_string()))?;
        let sizes =
            [("depth", depth.width(), depth.height()), ("mask", mask.width(), mask.height())];
        for (name, width, height) in sizes {
            if (width, height) != (color.width(), color.height()) {
                let (w, h) = (color.width(), color.height());
                let reason = format!("the image is {width}x{height} pixels, rgb is {w}x{h}");
                return Err(field(name, reason));
            }
        }
        let mesh = TriMesh::load(&folder.join(&layout.mesh)).map_err(|e| fault(&e))?;
        let mesh = mesh.scaled(layout.mesh_unit.meters());
        let name = folder.join(&layout.mesh).display().to_string();
        let object = Object::with_mass(&name, mesh, layout.mass_kg, seed).map_err(|e| fault(&e))?;
        let t_cam_object = layout.pose.isometry().map_err(|reason| field("pose", reason))?;
        let (robot, hand) = match &layout.robot {
            None => (None, None),
            Some(r) => {
                let tree = KinematicTree::from_urdf_file(folder.join(&r.urdf));
                let tree = tree.map_err(|e| fault(&e))?;
                let joints = tree.joint_vector(&r.joints);
                let joints = joints.map_err(|e| field("robot.joints", e.to_string()))?;
                let skin: Vec<Taxel> = match &r.taxels {
                    Some(csv) => load_taxels(&folder.join(csv)).map_err(|e| fault(&e))?,
                    None => Vec::new(),
                };
                let forces = r.forces.as_deref().unwrap_or_default();
                if !forces.is_empty() && forces.len() != skin.len() {
                    let (expected, found) = (skin.len(), forces.len());
                    let reason =
                        format!("expected one force for each of {expected} taxels, found {found}");
                    return Err(field("robot.forces", reason));
                }
                let t_cam_hand = r.base_pose.isometry();
                let hand = HandMeasurement {
                    t_cam_hand: t_cam_hand.map_err(|reason| field("robot.base_pose", reason))?,
                    joints,
                    forces: forces.iter().map(|&f| Vector3::from(f)).collect(),
                };
                let robot = Hand::cached(tree, skin, cache).map_err(|e| fault(&e))?;
                (Some(Arc::new(robot)), Some(hand))
            }
        };
        let gravity = layout.gravity.map(Vector3::from);
        gravity.map_or(Ok(()), |g| check_gravity(&g)).map_err(|reason| field("gravity", reason))?;
        let observation = Observation { camera, color, depth, mask, gravity, hand };
        Ok(Self { observation, object, robot, t_cam_object })
    }

    /// Whether the frame brings the evidence that a gradient needs.
    pub fn offers(&self, gradient: GradientKind) -> bool {
        match gradient {
            GradientKind::Rendering | GradientKind::Depth => true,
            GradientKind::Physics => self.robot.is_some() && self.observation.gravity.is_some(),
            GradientKind::Tactile => {
                self.observation.hand.as_ref().is_some_and(|hand| !hand.forces.is_empty())
            }
        }
    }
}

/// The file's layout.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Layout {
    /// Row-major 3×3 intrinsics \[px\].
    #[serde(rename = "K")]
    k: [f64; 9],
    rgb: PathBuf,
    depth: PathBuf,
    /// Meters of one unit of the depth image.
    depth_unit_m: f64,
    mask: PathBuf,
    mesh: PathBuf,
    mesh_unit: Unit,
    mass_kg: Option<f64>,
    pose: Pose,
    gravity: Option<[f64; 3]>,
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

/// A pose into the camera frame: a 4×4 matrix, or a quaternion whose name says its order.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Pose {
    unit: Unit,
    matrix: Option<[[f64; 4]; 4]>,
    quaternion_wxyz: Option<[f64; 4]>,
    quaternion_xyzw: Option<[f64; 4]>,
    translation: Option<[f64; 3]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotLayout {
    urdf: PathBuf,
    base_pose: Pose,
    joints: BTreeMap<String, f64>,
    taxels: Option<PathBuf>,
    /// Force of the object on each taxel, in its link's frame \[N\].
    forces: Option<Vec<[f64; 3]>>,
}

impl Pose {
    fn isometry(&self) -> Result<Isometry3<f64>, String> {
        let scale = self.unit.meters();
        let from_quaternion = |[w, x, y, z]: [f64; 4]| {
            let q = Quaternion::new(w, x, y, z);
            let norm = q.norm();
            if (norm - 1.0).abs() > 1e-3 || !norm.is_finite() {
                return Err(format!("the quaternion has norm {norm}, not 1"));
            }
            let [tx, ty, tz] = self.translation.ok_or("a quaternion needs a translation")?;
            Ok((UnitQuaternion::new_normalize(q), Vector3::new(tx, ty, tz)))
        };
        let (rotation, translation) =
            match (&self.matrix, self.quaternion_wxyz, self.quaternion_xyzw) {
                (Some(m), None, None) => {
                    if m[3] != [0.0, 0.0, 0.0, 1.0] {
                        return Err("the matrix's last row must be 0 0 0 1".into());
                    }
                    let r = Matrix3::from_fn(|r, c| m[r][c]);
                    let row_major: [f64; 9] = std::array::from_fn(|i| r[(i / 3, i % 3)]);
                    let rotation =
                        rotation_from_row_major(&row_major).map_err(|e| e.to_string())?;
                    (rotation, Vector3::new(m[0][3], m[1][3], m[2][3]))
                }
                (None, Some(wxyz), None) => from_quaternion(wxyz)?,
                (None, None, Some([x, y, z, w])) => from_quaternion([w, x, y, z])?,
                _ => {
                    return Err(
                        "give exactly one of matrix, quaternion_wxyz and quaternion_xyzw".into()
                    );
                }
            };
        if !translation.iter().all(|v| v.is_finite()) {
            return Err("the translation is not finite".into());
        }
        Ok(Isometry3::from_parts(Translation3::from(translation * scale), rotation))
    }
}
