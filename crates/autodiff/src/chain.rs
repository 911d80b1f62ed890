//! The two ways a derivative passes through an operation; everything else is arithmetic on values.

/// A scalar that records how its value depends on its operands.
///
/// Implementing these five functions is all that a differentiation mode needs: `real_field.rs` derives
/// the whole of `RealField` from them.
pub(crate) trait Chain: Copy {
    /// A constant.
    fn lift(value: f64) -> Self;
    /// The plain value.
    fn primal(self) -> f64;
    /// Whether no derivative passes through this number.
    fn is_constant(self) -> bool;
    /// The result `value` of an operation on `self` whose derivative is `slope`.
    fn unary(self, value: f64, slope: f64) -> Self;
    /// The result `value` of an operation on `self` and `other` with partial derivatives `slopes`.
    fn binary(self, other: Self, value: f64, slopes: [f64; 2]) -> Self;
}

/// `slope * derivative`, but 0 where the operand does not move: 0 · ∞ must not make a NaN of a direction
/// that has nothing to do with the operation. Both sides are computed, so it is a select, not a branch.
#[inline]
pub(crate) fn through(slope: f64, derivative: f64) -> f64 {
    let product = slope * derivative;
    if derivative == 0.0 { 0.0 } else { product }
}
