//! Ranges of parameters.

use super::error::LawError;
use crate::magnitude::{LARGEST, SMALLEST};

/// Range of a parameter. Infinity and NaN are in none, but where a range says so; nor is what is larger than 10⁶⁰, or positive
/// and less than 10⁻⁶⁰ where it is to be positive: laws square and divide by such numbers, and raise them to the fifth power.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum ParameterRange {
    /// x > 0.
    Positive,
    /// x > 0 or infinite.
    PositiveOrInfinite,
    /// x ≥ 0.
    NotNegative,
    /// x ≥ 1.
    AtLeastOne,
    /// 0 ≤ x ≤ 1.
    Fraction,
    /// 0 < x ≤ 1.
    PositiveFraction,
    /// Every number.
    Finite,
}

impl ParameterRange {
    /// Checks that `value`, called `name` in the error, is in this range.
    ///
    /// # Errors
    /// [`LawError::Range`] if it is not.
    pub fn check(self, name: &'static str, value: f64) -> Result<(), LawError> {
        let inside = match self {
            Self::Positive => value > 0.0 && value.is_finite(),
            Self::PositiveOrInfinite => value > 0.0,
            Self::NotNegative => value >= 0.0 && value.is_finite(),
            Self::AtLeastOne => value >= 1.0 && value.is_finite(),
            Self::Fraction => (0.0..=1.0).contains(&value),
            Self::PositiveFraction => value > 0.0 && value <= 1.0,
            Self::Finite => value.is_finite(),
        };
        let range = match self {
            _ if !inside => self.as_str(),
            Self::PositiveOrInfinite if value == f64::INFINITY => return Ok(()),
            _ if value.abs() > LARGEST => "within ±1e60",
            Self::Positive | Self::PositiveOrInfinite | Self::PositiveFraction
                if value < SMALLEST =>
            {
                "at least 1e-60"
            }
            _ => return Ok(()),
        };
        Err(LawError::Range { name, range, value })
    }

    fn as_str(self) -> &'static str {
        match self {
            Self::Positive | Self::PositiveOrInfinite => "positive",
            Self::NotNegative => "zero or positive",
            Self::AtLeastOne => "at least 1",
            Self::Fraction => "in 0..=1",
            Self::PositiveFraction => "above 0 and at most 1",
            Self::Finite => "finite",
        }
    }
}
