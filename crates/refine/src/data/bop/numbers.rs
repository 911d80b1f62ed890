//! Numbers, lists of numbers, lenses and units, in range where they are read.

use std::str::FromStr;

use prehend_geometry::limits::MAX_NUMBER;
use prehend_render::{Camera, CameraError, Distortion, DistortionError};
use serde::Deserialize;

/// `N` numbers; a matrix may also be a list of rows.
#[derive(Clone, Copy, Debug, Deserialize)]
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
        Self::try_from(flat)
    }
}

/// `N` numbers separated by spaces.
impl<const N: usize> FromStr for Numbers<N> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |word: &str| word.parse().map_err(|_| format!("{word:?} is not a number"));
        let values: Vec<f64> = text.split_whitespace().map(number).collect::<Result<_, _>>()?;
        let numbers = Self::try_from(values)?;
        numbers.require_in_range()?;
        Ok(numbers)
    }
}

impl<const N: usize> TryFrom<Vec<f64>> for Numbers<N> {
    type Error = String;

    fn try_from(values: Vec<f64>) -> Result<Self, String> {
        let numbers = values.try_into().map(Self);
        numbers.map_err(|v: Vec<f64>| format!("expected {N} numbers, found {}", v.len()))
    }
}

impl<const N: usize> Numbers<N> {
    /// Refuses what [`require_in_range`] refuses, by its index.
    ///
    /// # Errors
    /// Error text of the first number out of range.
    pub(crate) fn require_in_range(&self) -> Result<(), String> {
        self.0.iter().enumerate().try_for_each(|(index, value)| {
            let checked = require_in_range(*value);
            checked.map(|_| ()).map_err(|problem| format!("value {index} {problem}"))
        })
    }
}

/// Refuses a number that is not finite or beyond [`MAX_NUMBER`].
///
/// # Errors
/// Error text of a number out of range.
pub(crate) fn require_in_range(value: f64) -> Result<f64, String> {
    match value.abs() {
        _ if !value.is_finite() => Err("is not finite".into()),
        size if size > MAX_NUMBER => Err(format!("is {value:e}, beyond ±{MAX_NUMBER:e}")),
        _ => Ok(value),
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

/// Row-major 3×3 intrinsics of a camera of unknown size.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "Numbers<9>")]
pub(crate) struct Intrinsics(pub(crate) Camera);

impl TryFrom<Numbers<9>> for Intrinsics {
    type Error = CameraError;

    fn try_from(k: Numbers<9>) -> Result<Self, CameraError> {
        Camera::from_k(k.0, 1, 1).map(Self)
    }
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
pub enum LengthUnit {
    /// m.
    #[serde(rename = "m")]
    Meter,
    /// mm.
    #[serde(rename = "mm")]
    Millimeter,
}

impl LengthUnit {
    /// Meters of one unit.
    pub fn meters(self) -> f64 {
        match self {
            Self::Meter => 1.0,
            Self::Millimeter => 1e-3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_counted_and_named() {
        assert_eq!(" 1 2.5  -3e-2 ".parse::<Numbers<3>>().map(|n| n.0), Ok([1.0, 2.5, -0.03]));
        for (text, expected) in [
            ("1 2", "expected 3 numbers, found 2"),
            ("1 2 3 4", "expected 3 numbers, found 4"),
            ("1 2x 3", "\"2x\" is not a number"),
            ("nan 2 3", "value 0 is not finite"),
            ("1 2 -1e308", "value 2 is -1e308, beyond ±1e9"),
        ] {
            assert_eq!(text.parse::<Numbers<3>>().unwrap_err(), expected);
        }
    }
}
