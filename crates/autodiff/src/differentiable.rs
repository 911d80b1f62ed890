//! The two ways a derivative passes through an operation; everything else is arithmetic on values.

use crate::scalar::Scalar;

/// A scalar that records how its value depends on its operands.
///
/// Implementing these five functions is all that a differentiation mode needs: `real_field.rs` derives
/// the whole of `RealField` from them.
pub(crate) trait Differentiable: Copy {
    /// Scalar type of values and slopes: `f64`, or another one for derivatives of derivatives.
    type Inner: Scalar;

    /// A plain number as a value or slope.
    #[inline]
    fn inner(value: f64) -> Self::Inner {
        Self::Inner::constant(value)
    }

    /// A constant.
    fn lift(value: Self::Inner) -> Self;
    /// The value without this scalar's own derivatives.
    fn primal(self) -> Self::Inner;
    /// Whether no derivative passes through this number.
    fn is_constant(self) -> bool;
    /// The result `value` of an operation on `self` whose derivative is `slope`.
    fn unary(self, value: Self::Inner, slope: Self::Inner) -> Self;
    /// The result `value` of an operation on `self` and `other` with partial derivatives `slopes`.
    fn binary(self, other: Self, value: Self::Inner, slopes: [Self::Inner; 2]) -> Self;

    /// [`binary`](Self::binary) for slopes that are infinite only where an operand is.
    #[inline(always)]
    fn product(self, other: Self, value: Self::Inner, slopes: [Self::Inner; 2]) -> Self {
        self.binary(other, value, slopes)
    }
}

/// `slope * derivative`, but 0 if either is: 0 · ∞ must not make a NaN of a direction that has nothing to do
/// with the operation, nor of a branch that was not taken.
#[inline]
pub(crate) fn chain(slope: f64, derivative: f64) -> f64 {
    if slope == 0.0 || derivative == 0.0 { 0.0 } else { slope * derivative }
}

/// [`chain`] where the operators of reverse mode are: 0 only for a number that does not move. A select and
/// not a branch with a call, which was measured to slow recording by a third.
#[inline(always)]
pub(crate) fn chain_active(slope: f64, coefficient: f64) -> f64 {
    let product = slope * coefficient;
    if coefficient == 0.0 { 0.0 } else { product }
}
