//! Bounds of the magnitude of numbers.

/// The largest number, and the smallest that is positive: their fifth powers and those of their inverses are still numbers.
pub(crate) const LARGEST: f64 = 1e60;
pub(crate) const SMALLEST: f64 = 1e-60;
