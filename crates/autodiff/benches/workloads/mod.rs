//! Functions of increasing size whose gradients are timed: written once over nalgebra's `RealField`,
//! so that every kind of differentiable number runs the same text.
//!
//! Whoever mounts this module names the nalgebra to use (`super::nalgebra`): the comparison with other
//! crates mounts it a second time over an older one. `ours.rs` and `table.rs` are mounted beside it.

use super::nalgebra;

pub(crate) mod point_mass;
pub(crate) mod rigid_body;
pub(crate) mod rosenbrock;

use nalgebra::RealField;

/// A constant of the number type at hand.
#[inline]
fn constant<T: RealField>(value: f64) -> T {
    nalgebra::convert(value)
}

/// The plain value of a number, without its derivatives.
#[inline]
fn value<T: RealField>(number: T) -> f64 {
    nalgebra::convert_unchecked(number)
}
