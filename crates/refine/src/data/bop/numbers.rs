//! Numbers, lists of numbers and poses, in range where they are read.

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use prehend_render::{Distortion, DistortionError};
use serde::Deserialize;

use super::pose::{
    deviation_from_rotation, exactly, pose_from_matrix, require_in_range, rotation_from_row_major,
    translation_from_mm,
};

/// `N` numbers; a matrix may also be a list of rows.
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "Vec<NumberOrRow>")]
pub(crate) struct Numbers<const N: usize>(pub(crate) [f64; N]);

#[derive(Deserialize)]
#[serde(untagged, expecting = "is not a number")]
enum NumberOrRow {
    Number(f64),
    Row(Vec<f64>),
}

impl<const N: usize> TryFrom<Vec<NumberOrRow>> for Numbers<N> {
    type Error = String;

    fn try_from(list: Vec<NumberOrRow>) -> Result<Self, String> {
        let flat = list.into_iter().flat_map(|entry| match entry {
            NumberOrRow::Number(value) => vec![value],
            NumberOrRow::Row(values) => values,
        });
        let flat: Vec<f64> = flat.map(require_in_range).collect::<Result<_, _>>()?;
        exactly(flat).map(Self)
    }
}

/// A number within range, as large as `LEAST` says.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "f64")]
pub(crate) struct Bounded<const LEAST: usize>(pub(crate) f64);

/// A number within range.
pub(crate) type Real = Bounded<ANY>;
/// A number above zero.
pub(crate) type Positive = Bounded<POSITIVE>;
/// A number that is zero or above.
pub(crate) type NonNegative = Bounded<NON_NEGATIVE>;

const ANY: usize = 0;
const POSITIVE: usize = 1;
const NON_NEGATIVE: usize = 2;

impl<const LEAST: usize> TryFrom<f64> for Bounded<LEAST> {
    type Error = String;

    fn try_from(value: f64) -> Result<Self, String> {
        match (LEAST, require_in_range(value)?) {
            (POSITIVE, value) if value <= 0.0 => Err("must be above zero".into()),
            (NON_NEGATIVE, value) if value < 0.0 => Err(format!("{value} is below zero")),
            (_, value) => Ok(Self(value)),
        }
    }
}

/// A rotation of nine row-major entries.
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "Numbers<9>")]
pub(crate) struct Rotation(
    pub(crate) UnitQuaternion<f64>,
    /// Deviation of the matrix from orthonormality, where that was more than rounding.
    pub(crate) Option<f64>,
);

impl TryFrom<Numbers<9>> for Rotation {
    type Error = String;

    fn try_from(numbers: Numbers<9>) -> Result<Self, String> {
        let rotation = rotation_from_row_major(&numbers.0)?;
        Ok(Self(rotation, deviation_from_rotation(&numbers.0)))
    }
}

/// The pose \[m\] of a rotation and a translation \[mm\].
pub(crate) fn pose(rotation: &Rotation, translation: &Numbers<3>) -> Isometry3<f64> {
    Isometry3::from_parts(translation_from_mm(&translation.0), rotation.0)
}

/// A lens: the name of its model, and the coefficients in the order of OpenCV.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "LensEntry")]
pub(crate) struct Lens(pub(crate) Distortion);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LensEntry {
    model: String,
    coefficients: Vec<f64>,
}

impl TryFrom<LensEntry> for Lens {
    type Error = DistortionError;

    fn try_from(lens: LensEntry) -> Result<Self, DistortionError> {
        Distortion::by_name(&lens.model, &lens.coefficients).map(Self)
    }
}

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
