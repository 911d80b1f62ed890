//! Poses of frame files, which name their unit and the order of a quaternion.

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use serde::Deserialize;

use super::numbers::Numbers;
use super::pose::pose_from_matrix;

/// Unit of a length.
#[derive(Clone, Copy, Deserialize)]
pub(crate) enum LengthUnit {
    #[serde(rename = "m")]
    Meter,
    #[serde(rename = "mm")]
    Millimeter,
}

impl LengthUnit {
    pub(crate) fn meters(self) -> f64 {
        match self {
            Self::Meter => 1.0,
            Self::Millimeter => 1e-3,
        }
    }
}

/// A pose into the camera frame \[m\].
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "PoseEntry")]
pub(crate) struct FramePose(pub(crate) Isometry3<f64>);

/// A 4×4 matrix, or a quaternion whose name says its order.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PoseEntry {
    unit: LengthUnit,
    matrix: Option<Numbers<16>>,
    quaternion_wxyz: Option<Numbers<4>>,
    quaternion_xyzw: Option<Numbers<4>>,
    translation: Option<Numbers<3>>,
}

impl TryFrom<PoseEntry> for FramePose {
    type Error = String;

    fn try_from(entry: PoseEntry) -> Result<Self, String> {
        let wxyz = match (entry.matrix, entry.quaternion_wxyz, entry.quaternion_xyzw) {
            (Some(m), None, None) => {
                let mut pose = pose_from_matrix(&m.0)?;
                pose.translation.vector *= entry.unit.meters();
                return Ok(Self(pose));
            }
            (None, Some(wxyz), None) => wxyz.0,
            (None, None, Some(Numbers([x, y, z, w]))) => [w, x, y, z],
            _ => return Err("give exactly one of matrix, quaternion_wxyz, quaternion_xyzw".into()),
        };
        let [w, x, y, z] = wxyz;
        let q = Quaternion::new(w, x, y, z);
        let norm = q.norm();
        if (norm - 1.0).abs() > 1e-3 {
            return Err(format!("the quaternion has norm {norm}, not 1"));
        }
        let translation = entry.translation.ok_or("a quaternion needs a translation")?;
        let translation = Vector3::from(translation.0) * entry.unit.meters();
        let rotation = UnitQuaternion::new_normalize(q);
        Ok(Self(Isometry3::from_parts(translation.into(), rotation)))
    }
}
