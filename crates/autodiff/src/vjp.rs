//! The derivative of an operation that brings its own.

/// The reverse derivative of an operation with many inputs and outputs: a rendered image, a point set,
/// a linear solve.
///
/// The value has been computed outside the tape; what the derivative needs is saved in `self`, which
/// the tape owns until the recording ends.
pub trait CustomVjp: 'static {
    /// Adds to `input_adjoints` (zero at the call) the product of `output_adjoints` and the Jacobian (outputs × inputs).
    ///
    /// Runs in the midst of the sweep. It may open a [`Recording`](crate::Recording) of its own, but may not use
    /// numbers of others; it is called at least once for each seed that
    /// the sweep carries, and may then see adjoints that are NaN.
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]);
}
