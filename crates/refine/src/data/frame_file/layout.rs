//! What is in the file.

use std::collections::BTreeMap;
use std::path::PathBuf;

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use serde::Deserialize;

use crate::data::bop::{KindName, Lens, Numbers, Positive, Real, Rotation, TactileEntry};
use crate::data::pose::pose_from_matrix;

/// The file's layout.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Layout {
    /// Row-major 3×3 intrinsics \[px\].
    #[serde(rename = "K")]
    k: Numbers<9>,
    /// Through which the images were taken.
    #[serde(rename = "dist")]
    pub(super) lens: Option<Lens>,
    rgb: Option<PathBuf>,
    depth: Option<PathBuf>,
    /// Meters of one unit of the depth image.
    depth_unit_m: Option<Positive>,
    mask: Option<PathBuf>,
    #[serde(rename = "depth_K")]
    depth_k: Option<Numbers<9>>,
    #[serde(rename = "depth_dist")]
    depth_lens: Option<Lens>,
    #[serde(rename = "cam_R_d2c")]
    depth_rotation: Option<Rotation>,
    #[serde(rename = "cam_t_d2c")]
    depth_translation: Option<Numbers<3>>,
    /// Other cameras.
    #[serde(default)]
    pub(super) cameras: Vec<CameraLayout>,
    pub(super) mesh: PathBuf,
    pub(super) mesh_unit: Unit,
    pub(super) mass_kg: Option<Positive>,
    /// The object's number in a rig.
    pub(super) obj_id: Option<u32>,
    pub(super) pose: Pose,
    pub(super) gravity: Option<Numbers<3>>,
    pub(super) robot: Option<RobotLayout>,
    /// What is there besides.
    #[serde(default)]
    pub(super) bodies: Vec<BodyLayout>,
}

/// Another camera.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraLayout {
    #[serde(rename = "K")]
    k: Numbers<9>,
    #[serde(rename = "dist")]
    lens: Option<Lens>,
    rgb: Option<PathBuf>,
    depth: Option<PathBuf>,
    depth_unit_m: Option<Positive>,
    mask: Option<PathBuf>,
    #[serde(rename = "depth_K")]
    depth_k: Option<Numbers<9>>,
    #[serde(rename = "depth_dist")]
    depth_lens: Option<Lens>,
    #[serde(rename = "cam_R_d2c")]
    depth_rotation: Option<Rotation>,
    #[serde(rename = "cam_t_d2c")]
    depth_translation: Option<Numbers<3>>,
    /// Its coordinates → those of the first camera.
    pub(super) pose: Pose,
}

/// Images of one camera, and how they were taken.
pub(super) struct ImagesLayout<'a> {
    pub(super) k: [f64; 9],
    pub(super) lens: Option<Lens>,
    pub(super) rgb: Option<&'a PathBuf>,
    pub(super) depth: Option<&'a PathBuf>,
    pub(super) depth_unit_m: Option<Positive>,
    pub(super) mask: Option<&'a PathBuf>,
    pub(super) depth_k: Option<[f64; 9]>,
    pub(super) depth_lens: Option<Lens>,
    pub(super) depth_rotation: Option<UnitQuaternion<f64>>,
    pub(super) depth_translation: Option<[f64; 3]>,
}

/// Both layouts name the images of a camera alike: unknown fields are refused, so that one cannot be a part of the other.
macro_rules! images {
    ($layout:ty) => {
        impl $layout {
            /// Its images.
            pub(super) fn images(&self) -> ImagesLayout<'_> {
                ImagesLayout {
                    k: self.k.0,
                    lens: self.lens,
                    rgb: self.rgb.as_ref(),
                    depth: self.depth.as_ref(),
                    depth_unit_m: self.depth_unit_m,
                    mask: self.mask.as_ref(),
                    depth_k: self.depth_k.as_ref().map(|k| k.0),
                    depth_lens: self.depth_lens,
                    depth_rotation: self.depth_rotation.as_ref().map(|rotation| rotation.0),
                    depth_translation: self.depth_translation.as_ref().map(|mm| mm.0),
                }
            }
        }
    };
}

images!(Layout);
images!(CameraLayout);

#[derive(Clone, Copy, Deserialize)]
pub(super) enum Unit {
    #[serde(rename = "m")]
    Meter,
    #[serde(rename = "mm")]
    Millimeter,
}

impl Unit {
    pub(super) fn meters(self) -> f64 {
        match self {
            Self::Meter => 1.0,
            Self::Millimeter => 1e-3,
        }
    }
}

/// A pose into the camera frame \[m\].
#[derive(Deserialize)]
#[serde(try_from = "PoseLayout")]
pub(super) struct Pose(pub(super) Isometry3<f64>);

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
pub(super) struct RobotLayout {
    pub(super) urdf: PathBuf,
    pub(super) base_pose: Pose,
    pub(super) joints: BTreeMap<String, Real>,
    pub(super) sigma_mm: Option<Real>,
    pub(super) sigma_deg: Option<Real>,
    pub(super) taxels: Option<PathBuf>,
    /// Force of the object on each taxel, in its link's frame \[N\].
    pub(super) forces: Option<Vec<Numbers<3>>>,
    /// Sensors that measure no forces.
    #[serde(default)]
    pub(super) touch: Vec<TactileEntry>,
}

/// A body beside the object and the robot.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BodyLayout {
    pub(super) name: String,
    #[serde(default)]
    pub(super) kind: KindName,
    pub(super) pose: Pose,
    pub(super) sigma_mm: Option<Real>,
    pub(super) sigma_deg: Option<Real>,
    pub(super) urdf: Option<PathBuf>,
    pub(super) joints: Option<BTreeMap<String, Real>>,
    pub(super) mesh: Option<PathBuf>,
    pub(super) mesh_unit: Option<Unit>,
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
