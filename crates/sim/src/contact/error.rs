//! What is wrong with a law's or an onset's parameter.

use thiserror::Error;

/// A parameter of a contact law or of an onset out of its range.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("{name} must be {range}, is {value}")]
pub struct LawError {
    /// Name of the parameter.
    pub name: &'static str,
    /// What it must be.
    pub range: &'static str,
    /// What it is.
    pub value: f64,
}

impl LawError {
    fn check(ok: bool, name: &'static str, range: &'static str, value: f64) -> Result<(), Self> {
        if ok { Ok(()) } else { Err(Self { name, range, value }) }
    }

    pub(super) fn check_positive(name: &'static str, value: f64) -> Result<(), Self> {
        Self::check(value.is_finite() && value > 0.0, name, "positive", value)
    }

    pub(super) fn check_not_negative(name: &'static str, value: f64) -> Result<(), Self> {
        Self::check(value.is_finite() && value >= 0.0, name, "zero or positive", value)
    }

    pub(super) fn check_finite(name: &'static str, value: f64) -> Result<(), Self> {
        Self::check(value.is_finite(), name, "finite", value)
    }

    pub(super) fn check_at_least_one(name: &'static str, value: f64) -> Result<(), Self> {
        Self::check(value.is_finite() && value >= 1.0, name, "at least 1", value)
    }

    pub(super) fn check_fraction(name: &'static str, value: f64) -> Result<(), Self> {
        Self::check((0.0..=1.0).contains(&value), name, "in 0..=1", value)
    }

    pub(super) fn check_restitution(value: f64) -> Result<(), Self> {
        Self::check(value > 0.0 && value <= 1.0, "restitution", "above 0 and at most 1", value)
    }

    /// Like [`check_positive`](Self::check_positive), infinity included.
    pub(super) fn check_distance(name: &'static str, value: f64) -> Result<(), Self> {
        Self::check(value > 0.0, name, "positive", value)
    }
}
