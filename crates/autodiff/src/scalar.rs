//! The one scalar trait that simulation code is generic over.

use nalgebra::RealField;

/// A real number that may carry derivatives.
///
/// Code written over `S: Scalar` runs unchanged with `f32`, `f64`, forward-mode [`Fwd`](crate::Fwd)
/// and reverse-mode [`Var`](crate::Var), inside every nalgebra type.
pub trait Scalar: RealField + Copy + Default {
    /// A constant: carries no derivative.
    fn constant(value: f64) -> Self;

    /// The plain value, without its derivatives.
    fn value(self) -> f64;

    /// `if_true` where `condition` holds, else `if_false`.
    ///
    /// Unlike multiplying by 0 or 1, the branch not taken contributes no derivative, so an infinite
    /// or NaN derivative there cannot leak (`0 · ∞`). Write branches through it to stay lane-safe.
    fn select(condition: bool, if_true: Self, if_false: Self) -> Self;
}

macro_rules! plain_scalar {
    ($t:ty) => {
        impl Scalar for $t {
            #[inline]
            fn constant(value: f64) -> Self {
                value as $t
            }

            #[inline]
            #[allow(clippy::unnecessary_cast)]
            fn value(self) -> f64 {
                self as f64
            }

            #[inline]
            fn select(condition: bool, if_true: Self, if_false: Self) -> Self {
                if condition { if_true } else { if_false }
            }
        }
    };
}

plain_scalar!(f32);
plain_scalar!(f64);
