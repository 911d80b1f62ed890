//! Poses as plain numbers, for JSON files.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn every_bit_returns() {
        let pose = Isometry3::new(Vector3::new(0.1, -1.0 / 3.0, 0.7), Vector3::new(1.0, 2.0, -0.3));
        let text = serde_json::to_string(&PlainPose::from(&pose)).unwrap();
        let back: PlainPose = serde_json::from_str(&text).unwrap();
        assert_eq!(Isometry3::from(&back), pose);
        assert!(back.is_finite());
    }
}
