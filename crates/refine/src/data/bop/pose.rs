//! Poses as BOP writes them: nine row-major rotation entries and a translation in millimeters.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};
use thiserror::Error;

/// Largest entry of RᵀR − I that still counts as rounding; beyond it the matrix is refused.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// Why numbers do not make a pose.
#[derive(Clone, Debug, Error, PartialEq)]
pub(crate) enum PoseFault {
    /// The wrong number of values.
    #[error("expected {expected} numbers, found {found}")]
    Count {
        /// How many values the field needs.
        expected: usize,
        /// How many it has.
        found: usize,
    },
    /// A value that is no number.
    #[error("{text:?} is not a number")]
    NotANumber {
        /// The value as written.
        text: String,
    },
    /// NaN or an infinity.
    #[error("value {index} is not finite")]
    NotFinite {
        /// Position of the value in its field, from 0.
        index: usize,
    },
    /// RᵀR differs from the identity by more than [`ROTATION_TOLERANCE`].
    #[error(
        "not orthonormal: RᵀR differs from the identity by {deviation:.4} (at most {ROTATION_TOLERANCE} allowed)"
    )]
    NotOrthonormal {
        /// Largest entry of |RᵀR − I|.
        deviation: f64,
    },
    /// An orthonormal matrix of determinant −1.
    #[error("a reflection (determinant -1), not a rotation")]
    Reflection,
}

/// The rotation of nine row-major entries; rounding is removed by the nearest rotation (polar factor).
///
/// # Errors
/// [`PoseFault::NotFinite`], [`PoseFault::NotOrthonormal`] or [`PoseFault::Reflection`].
pub(crate) fn rotation_from_row_major(r: &[f64; 9]) -> Result<UnitQuaternion<f64>, PoseFault> {
    require_finite(r)?;
    let matrix = Matrix3::from_row_slice(r);
    let deviation = (matrix.transpose() * matrix - Matrix3::identity()).amax();
    if deviation > ROTATION_TOLERANCE {
        return Err(PoseFault::NotOrthonormal { deviation });
    }
    if matrix.determinant() < 0.0 {
        return Err(PoseFault::Reflection);
    }
    let nearest = polar_factor(matrix);
    Ok(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(nearest)))
}

/// The orthogonal polar factor of a nearly orthonormal matrix, by Newton's iteration
/// X ← (X + X⁻ᵀ)/2 (Higham, "Computing the polar decomposition", 1986), quadratic from 1e-3.
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
///
/// # Errors
/// [`PoseFault::NotFinite`].
pub(crate) fn translation_from_mm(t_mm: &[f64; 3]) -> Result<Translation3<f64>, PoseFault> {
    require_finite(t_mm)?;
    let [x, y, z] = t_mm.map(|v| v / 1000.0);
    Ok(Translation3::new(x, y, z))
}

/// The millimeter values of a translation \[m\].
pub(crate) fn translation_to_mm(translation: &Translation3<f64>) -> [f64; 3] {
    let t = translation.vector;
    [t.x * 1000.0, t.y * 1000.0, t.z * 1000.0]
}

/// The pose \[m\] of a row-major rotation and a millimeter translation.
///
/// # Errors
/// Those of [`rotation_from_row_major`] and [`translation_from_mm`].
pub(crate) fn pose_from_bop(r: &[f64; 9], t_mm: &[f64; 3]) -> Result<Isometry3<f64>, PoseFault> {
    Ok(Isometry3::from_parts(translation_from_mm(t_mm)?, rotation_from_row_major(r)?))
}

/// `N` finite numbers separated by spaces.
pub(crate) fn parse_numbers<const N: usize>(text: &str) -> Result<[f64; N], PoseFault> {
    let mut values = [0.0; N];
    let mut found = 0;
    for word in text.split_whitespace() {
        let value = word.parse().map_err(|_| PoseFault::NotANumber { text: word.to_owned() })?;
        if let Some(slot) = values.get_mut(found) {
            *slot = value;
        }
        found += 1;
    }
    if found != N {
        return Err(PoseFault::Count { expected: N, found });
    }
    require_finite(&values)?;
    Ok(values)
}

fn require_finite(values: &[f64]) -> Result<(), PoseFault> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(PoseFault::NotFinite { index }),
        None => Ok(()),
    }
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
    fn refuses_what_is_no_rotation() {
        let r = rotation_to_row_major(&some_rotation());
        let stretched = r.map(|v| v * 1.01);
        assert!(matches!(
            rotation_from_row_major(&stretched),
            Err(PoseFault::NotOrthonormal { .. })
        ));
        assert_eq!(rotation_from_row_major(&r.map(|v| -v)), Err(PoseFault::Reflection));
        let mut nan = r;
        nan[4] = f64::NAN;
        assert_eq!(rotation_from_row_major(&nan), Err(PoseFault::NotFinite { index: 4 }));
        assert_eq!(
            translation_from_mm(&[0.0, 0.0, f64::INFINITY]),
            Err(PoseFault::NotFinite { index: 2 })
        );
    }

    #[test]
    fn numbers_are_counted_and_named() {
        assert_eq!(parse_numbers::<3>(" 1 2.5  -3e-2 "), Ok([1.0, 2.5, -0.03]));
        assert_eq!(parse_numbers::<3>("1 2"), Err(PoseFault::Count { expected: 3, found: 2 }));
        assert_eq!(parse_numbers::<3>("1 2 3 4"), Err(PoseFault::Count { expected: 3, found: 4 }));
        assert_eq!(parse_numbers::<2>("1 2x"), Err(PoseFault::NotANumber { text: "2x".into() }));
        assert_eq!(parse_numbers::<2>("nan 2"), Err(PoseFault::NotFinite { index: 0 }));
    }
}
