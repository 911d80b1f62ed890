//! The number of reverse mode, which knows where on the tape it came from.

/// A number on the thread's tape.
///
/// `Var` is plain `Copy` data, so it fits in every nalgebra type. A chain of operations with a single
/// active operand is fused into one coefficient and never reaches the tape; only joining two active
/// numbers records a node.
///
/// # Panics
/// Joining numbers of different recordings (a finished one, or one of another thread) panics with a
/// message that says so: there is no way to return an error from `+`, and a wrong derivative would be
/// silent.
#[derive(Clone, Copy, Debug)]
pub struct Var {
    pub(crate) value: f64,
    /// Derivative with respect to `node`.
    pub(crate) coefficient: f64,
    pub(crate) node: u32,
    /// The recording that owns `node`; 0 for constants.
    pub(crate) recording: u32,
}

impl Var {
    /// The plain value.
    #[inline]
    pub fn value(self) -> f64 {
        self.value
    }

    /// The node whose adjoint is this number's derivative; none for a constant.
    ///
    /// # Panics
    /// If the number belongs to another recording or is not the node itself.
    pub(crate) fn own_node(self, recording: u32) -> Option<u32> {
        if self.recording == 0 {
            return None;
        }
        assert!(self.recording == recording, "the number belongs to another recording");
        assert!(self.coefficient == 1.0, "only variables have an adjoint, not fused operations");
        Some(self.node)
    }
}
