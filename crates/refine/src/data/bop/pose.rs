//! Poses as BOP writes them: nine row-major rotation entries and a translation in millimeters.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};
use prehend_geometry::limits::MAX_NUMBER;

/// Largest entry of RᵀR − I with which a matrix still counts as a rotation: published ground truth is up to 9e-3 off (LM-O).
const ROTATION_TOLERANCE: f64 = 2e-2;
/// Largest entry of RᵀR − I that is rounding, of which nobody needs to be told.
const ROUNDING: f64 = 1e-3;

/// Largest entry of RᵀR − I.
fn deviation(matrix: &Matrix3<f64>) -> f64 {
    (matrix.transpose() * matrix - Matrix3::identity()).amax()
}

/// Largest entry of RᵀR − I of nine row-major entries, where it is more than rounding.
pub(crate) fn deviation_from_rotation(r: &[f64; 9]) -> Option<f64> {
    Some(deviation(&Matrix3::from_row_slice(r))).filter(|deviation| *deviation > ROUNDING)
}

/// Warning about a file whose rotations are up to `deviation` from orthonormal.
pub(crate) fn rotations_off(file: &Path, deviation: f64) -> String {
    let file = file.display();
    format!(
        "{file}: rotations are not quite orthonormal (RᵀR is up to {deviation:.4} off); the nearest rotations are used"
    )
}

/// The rotation nearest to nine row-major entries (polar factor).
///
/// # Errors
/// What is wrong with entries that are not finite, not orthonormal, or a reflection.
pub(crate) fn rotation_from_row_major(r: &[f64; 9]) -> Result<UnitQuaternion<f64>, String> {
    require_all_in_range(r)?;
    let matrix = Matrix3::from_row_slice(r);
    let deviation = deviation(&matrix);
    if deviation > ROTATION_TOLERANCE {
        return Err(format!(
            "not orthonormal: RᵀR differs from the identity by {deviation:.4} (at most {ROTATION_TOLERANCE} allowed)"
        ));
    }
    if matrix.determinant() < 0.0 {
        return Err("a reflection (determinant -1), not a rotation".into());
    }
    let nearest = polar_factor(matrix);
    Ok(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(nearest)))
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

/// A translation \[m\] of three millimeter values.
pub(crate) fn translation_from_mm(t_mm: &[f64; 3]) -> Translation3<f64> {
    t_mm.map(|v| v / 1000.0).into()
}

/// The millimeter values of a translation \[m\].
pub(crate) fn translation_to_mm(translation: &Translation3<f64>) -> [f64; 3] {
    (translation.vector * 1000.0).into()
}

/// The pose \[m\] of a row-major rotation and a millimeter translation.
///
/// # Errors
/// Those of [`rotation_from_row_major`].
pub(crate) fn pose_from_bop(r: &[f64; 9], t_mm: &[f64; 3]) -> Result<Isometry3<f64>, String> {
    Ok(Isometry3::from_parts(translation_from_mm(t_mm), rotation_from_row_major(r)?))
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
    let row_major = std::array::from_fn(|i| m[4 * (i / 3) + i % 3]);
    let rotation = rotation_from_row_major(&row_major)?;
    Ok(Isometry3::from_parts(Translation3::from(translation), rotation))
}

/// `N` finite numbers separated by spaces.
pub(crate) fn parse_numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let number = |word: &str| word.parse().map_err(|_| format!("{word:?} is not a number"));
    let values = exactly(text.split_whitespace().map(number).collect::<Result<_, _>>()?)?;
    require_all_in_range(&values)?;
    Ok(values)
}

/// The values if there are `N`.
pub(super) fn exactly<const N: usize>(values: Vec<f64>) -> Result<[f64; N], String> {
    values.try_into().map_err(|v: Vec<f64>| format!("expected {N} numbers, found {}", v.len()))
}

/// Refuses a number that is not finite or beyond [`MAX_NUMBER`].
///
/// # Errors
/// What is wrong with it.
pub(crate) fn require_in_range(value: f64) -> Result<f64, String> {
    match value.abs() {
        _ if !value.is_finite() => Err("is not finite".into()),
        size if size > MAX_NUMBER => Err(format!("is {value:e}, beyond ±{MAX_NUMBER:e}")),
        _ => Ok(value),
    }
}

fn require_all_in_range(values: &[f64]) -> Result<(), String> {
    values.iter().enumerate().try_for_each(|(index, value)| {
        let checked = require_in_range(*value);
        checked.map(|_| ()).map_err(|problem| format!("value {index} {problem}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn some_rotation() -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(Vector3::new(0.7, -1.9, 0.4))
    }

    #[test]
    fn rows_and_poses_convert_both_ways() {
        let r = rotation_to_row_major(&some_rotation());
        let t_mm = [17.495194, -6.548735, 437.915208];
        let pose = pose_from_bop(&r, &t_mm).unwrap();
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
        let rotation =
            rotation_from_row_major(&std::array::from_fn(|i| noisy[(i / 3, i % 3)])).unwrap();
        // m·symmetric is a polar decomposition already, so the factor must be m itself.
        assert!(rotation.angle_to(&some_rotation()) < 1e-14);
    }

    #[test]
    fn published_truth_is_made_a_rotation() {
        // Row lengths of 1 + 4e-3, as LM-O has them.
        let r = rotation_to_row_major(&some_rotation()).map(|v| v * 1.004);
        assert!(rotation_from_row_major(&r).unwrap().angle_to(&some_rotation()) < 1e-14);
        assert!((deviation_from_rotation(&r).unwrap() - 0.008).abs() < 1e-4);
        assert_eq!(deviation_from_rotation(&rotation_to_row_major(&some_rotation())), None);
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
            assert!(rotation_from_row_major(&entries).unwrap_err().starts_with(expected));
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
    fn numbers_are_counted_and_named() {
        assert_eq!(parse_numbers(" 1 2.5  -3e-2 "), Ok([1.0, 2.5, -0.03]));
        for (text, expected) in [
            ("1 2", "expected 3 numbers, found 2"),
            ("1 2 3 4", "expected 3 numbers, found 4"),
            ("1 2x 3", "\"2x\" is not a number"),
            ("nan 2 3", "value 0 is not finite"),
            ("1 2 -1e308", "value 2 is -1e308, beyond ±1e9"),
        ] {
            assert_eq!(parse_numbers::<3>(text).unwrap_err(), expected);
        }
    }
}
