//! Poses as plain numbers, for JSON files.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use crate::data::bop::{require_in_range, rotation_from_row_major};

/// A pose for serialization: reading restores every bit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlainPose {
    /// Rotation, real part first.
    pub quaternion_wxyz: [f64; 4],
    /// Translation \[m\].
    pub translation_m: [f64; 3],
}

impl PlainPose {
    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        self.quaternion_wxyz.iter().chain(&self.translation_m).all(|v| v.is_finite())
    }
}

impl From<&Isometry3<f64>> for PlainPose {
    fn from(pose: &Isometry3<f64>) -> Self {
        let q = pose.rotation.quaternion();
        Self {
            quaternion_wxyz: [q.w, q.i, q.j, q.k],
            translation_m: pose.translation.vector.into(),
        }
    }
}

impl From<&PlainPose> for Isometry3<f64> {
    fn from(plain: &PlainPose) -> Self {
        let [w, i, j, k] = plain.quaternion_wxyz;
        let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
        Self::from_parts(Translation3::from(plain.translation_m), rotation)
    }
}

/// The pose \[m\] of a 4×4 matrix in row-major order. A rotation that is up to 0.02 from orthonormal is replaced by the nearest one.
///
/// # Errors
/// What is wrong with a matrix that is no pose.
pub fn pose_from_matrix(m: &[f64; 16]) -> Result<Isometry3<f64>, String> {
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err("the matrix's last row must be 0 0 0 1".into());
    }
    let translation = [m[3], m[7], m[11]];
    for value in translation {
        require_in_range(value).map_err(|problem| format!("the translation {problem}"))?;
    }
    let row_major = std::array::from_fn(|i| m[4 * (i / 3) + i % 3]);
    let rotation = rotation_from_row_major(&row_major)?;
    Ok(Isometry3::from_parts(Translation3::from(translation), rotation))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_matrix_of_single_precision_is_a_pose_and_a_scaled_one_is_none() {
        let pose = Isometry3::new(Vector3::new(0.1, -0.2, 0.7), Vector3::new(1.0, 2.0, -0.3));
        let mut m: [f64; 16] = pose.to_homogeneous().transpose().as_slice().try_into().unwrap();
        m.iter_mut().for_each(|v| *v = f64::from(*v as f32));
        let read = pose_from_matrix(&m).unwrap();
        assert!(read.rotation.angle_to(&pose.rotation) < 1e-6);
        assert!(pose_from_matrix(&m.map(|v| 1.1 * v)).unwrap_err().contains("last row"));
        m[0] = f64::NAN;
        assert!(pose_from_matrix(&m).unwrap_err().contains("not finite"));
    }

    #[test]
    fn every_bit_returns() {
        let pose = Isometry3::new(Vector3::new(0.1, -1.0 / 3.0, 0.7), Vector3::new(1.0, 2.0, -0.3));
        let text = serde_json::to_string(&PlainPose::from(&pose)).unwrap();
        let back: PlainPose = serde_json::from_str(&text).unwrap();
        assert_eq!(Isometry3::from(&back), pose);
        assert!(back.is_finite());
    }
}
