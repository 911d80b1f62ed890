//! Poses in files: nine row-major rotation entries and a translation in millimeters, as BOP writes them, or matrices and quaternions with their units.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;

use super::numbers::{LengthUnit, Numbers, require_in_range};

/// Largest entry of RᵀR − I with which a matrix still counts as a rotation: published ground truth is up to 9e-3 off (LM-O).
const ROTATION_TOLERANCE: f64 = 2e-2;
/// Largest entry of RᵀR − I that is rounding, of which nobody needs to be told.
const ROUNDING: f64 = 1e-3;

/// A rotation of nine row-major entries: that nearest to them (polar factor).
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "Numbers<9>")]
pub(crate) struct Rotation {
    pub(crate) nearest: UnitQuaternion<f64>,
    /// Largest entry of RᵀR − I of the entries R, where it is more than rounding.
    pub(crate) deviation: Option<f64>,
}

/// Warning about a file whose rotations are up to `deviation` from orthonormal.
pub(crate) fn rotations_off(file: &Path, deviation: f64) -> String {
    let file = file.display();
    format!(
        "{file}: rotations are not quite orthonormal (RᵀR is up to {deviation:.4} off); the nearest rotations are used"
    )
}

impl TryFrom<Numbers<9>> for Rotation {
    type Error = String;

    /// # Errors
    /// Error text for entries that are not finite, not orthonormal, or a reflection.
    fn try_from(numbers: Numbers<9>) -> Result<Self, String> {
        numbers.require_in_range()?;
        let matrix = Matrix3::from_row_slice(&numbers.0);
        let deviation = (matrix.transpose() * matrix - Matrix3::identity()).amax();
        if deviation > ROTATION_TOLERANCE {
            return Err(format!(
                "not orthonormal: RᵀR differs from the identity by {deviation:.4} (at most {ROTATION_TOLERANCE} allowed)"
            ));
        }
        if matrix.determinant() < 0.0 {
            return Err("a reflection (determinant -1), not a rotation".into());
        }
        let nearest = Rotation3::from_matrix_unchecked(polar_factor(matrix));
        let nearest = UnitQuaternion::from_rotation_matrix(&nearest);
        Ok(Self { nearest, deviation: Some(deviation).filter(|deviation| *deviation > ROUNDING) })
    }
}

/// The orthogonal polar factor of a nearly orthonormal matrix, by Newton's iteration
/// X ← (X + X⁻ᵀ)/2 (Higham, "Computing the polar decomposition", 1986), quadratic from 2e-2.
fn polar_factor(mut matrix: Matrix3<f64>) -> Matrix3<f64> {
    for _ in 0..4 {
        if let Some(inverse) = matrix.try_inverse() {
            matrix = (matrix + inverse.transpose()) * 0.5;
        }
    }
    matrix
}

/// The nine row-major entries of a rotation.
pub(crate) fn rotation_to_row_major(rotation: &UnitQuaternion<f64>) -> [f64; 9] {
    let m = rotation.to_rotation_matrix().into_inner();
    std::array::from_fn(|i| m[(i / 3, i % 3)])
}

/// The millimeter values of a translation \[m\].
pub(crate) fn translation_to_mm(translation: &Translation3<f64>) -> [f64; 3] {
    (translation.vector * 1000.0).into()
}

/// The pose \[m\] of a rotation and a translation \[mm\].
pub(crate) fn pose(rotation: &Rotation, translation: &Numbers<3>) -> Isometry3<f64> {
    let translation = translation.0.map(|mm| mm / 1000.0);
    Isometry3::from_parts(translation.into(), rotation.nearest)
}

/// The pose \[m\] of `cam_R_…` and `cam_t_…` \[mm\], whose names end in `between`; `None` without either.
///
/// # Errors
/// The name of the one that is missing.
pub(crate) fn stated_pose(
    rotation: Option<Rotation>,
    translation: Option<Numbers<3>>,
    between: &str,
) -> Result<Option<Isometry3<f64>>, String> {
    match (rotation, translation) {
        (None, None) => Ok(None),
        (Some(rotation), Some(mm)) => Ok(Some(pose(&rotation, &mm))),
        (None, Some(_)) => Err(format!("cam_R_{between}")),
        (Some(_), None) => Err(format!("cam_t_{between}")),
    }
}

/// The pose \[m\] of a 4×4 matrix in row-major order. A rotation that is up to 0.02 from orthonormal is replaced by the nearest one.
///
/// # Errors
/// Reason why a matrix is no pose.
pub fn pose_from_matrix(m: &[f64; 16]) -> Result<Isometry3<f64>, String> {
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err("the matrix's last row must be 0 0 0 1".into());
    }
    let translation = [m[3], m[7], m[11]];
    for value in translation {
        require_in_range(value).map_err(|problem| format!("the translation {problem}"))?;
    }
    let row_major = Numbers(std::array::from_fn(|i| m[4 * (i / 3) + i % 3]));
    let rotation = Rotation::try_from(row_major)?.nearest;
    Ok(Isometry3::from_parts(Translation3::from(translation), rotation))
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

#[cfg(test)]
mod tests {
    use super::*;

    fn some_rotation() -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(Vector3::new(0.7, -1.9, 0.4))
    }

    #[test]
    fn rows_and_poses_convert_both_ways() {
        let r = rotation_to_row_major(&some_rotation());
        let t_mm = [17.495194, -6.548735, 437.915208];
        let pose = pose(&Numbers(r).try_into().unwrap(), &Numbers(t_mm));
        assert!(pose.rotation.angle_to(&some_rotation()) < 1e-15);
        assert!((pose.translation.vector.z - 0.437915208).abs() < 1e-16);
        let back = translation_to_mm(&pose.translation);
        assert!(back.iter().zip(t_mm).all(|(a, b)| (a - b).abs() < 1e-12));
        // Row-major: the second entry is row 0, column 1, the x component of the rotated y axis.
        assert!((r[1] - (some_rotation() * Vector3::y()).x).abs() < 1e-15);
    }

    #[test]
    fn a_slightly_scaled_and_sheared_matrix_snaps_to_the_nearest_rotation() {
        let m = some_rotation().to_rotation_matrix().into_inner();
        let symmetric = Matrix3::new(1.0002, 1e-4, 0.0, 1e-4, 0.9998, -5e-5, 0.0, -5e-5, 1.0001);
        let noisy = m * symmetric;
        let entries = Numbers(std::array::from_fn(|i| noisy[(i / 3, i % 3)]));
        let rotation = Rotation::try_from(entries).unwrap().nearest;
        // m·symmetric is a polar decomposition already, so the factor must be m itself.
        assert!(rotation.angle_to(&some_rotation()) < 1e-14);
    }

    #[test]
    fn published_truth_is_made_a_rotation() {
        // Row lengths of 1 + 4e-3, as LM-O has them.
        let r = rotation_to_row_major(&some_rotation()).map(|v| v * 1.004);
        let read = Rotation::try_from(Numbers(r)).unwrap();
        assert!(read.nearest.angle_to(&some_rotation()) < 1e-14);
        assert!((read.deviation.unwrap() - 0.008).abs() < 1e-4);
        let exact = Numbers(rotation_to_row_major(&some_rotation()));
        assert_eq!(Rotation::try_from(exact).unwrap().deviation, None);
    }

    #[test]
    fn refuses_what_is_no_rotation() {
        let r = rotation_to_row_major(&some_rotation());
        let mut nan = r;
        nan[4] = f64::NAN;
        for (entries, expected) in [
            (r.map(|v| v * 1.01), "not orthonormal: "),
            (r.map(|v| -v), "a reflection"),
            (nan, "value 4 is not finite"),
        ] {
            assert!(Rotation::try_from(Numbers(entries)).unwrap_err().starts_with(expected));
        }
    }

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
    fn the_missing_part_of_a_pose_is_named() {
        let rotation = Rotation::try_from(Numbers(rotation_to_row_major(&some_rotation()))).ok();
        let translation = Some(Numbers([10.0, 0.0, 0.0]));
        let missing = |rotation, translation| stated_pose(rotation, translation, "d2c").err();
        assert_eq!(missing(None, translation), Some("cam_R_d2c".to_owned()));
        assert_eq!(missing(rotation, None), Some("cam_t_d2c".to_owned()));
        assert_eq!(stated_pose(None, None, "d2c"), Ok(None));
        let known = stated_pose(rotation, translation, "d2c").unwrap().unwrap();
        assert_eq!(known.translation.x, 0.01);
    }
}
