//! Reverse mode: a number that remembers where on the tape it came from.

use crate::chain::{Chain, through};
use crate::real_field::impl_real_field;
use crate::tape::with_tape;

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
}

impl Chain for Var {
    #[inline]
    fn lift(value: f64) -> Self {
        Self { value, coefficient: 0.0, node: 0, recording: 0 }
    }

    #[inline]
    fn primal(self) -> f64 {
        self.value
    }

    #[inline]
    fn is_constant(self) -> bool {
        self.recording == 0
    }

    #[inline]
    fn unary(self, value: f64, slope: f64) -> Self {
        if self.is_constant() {
            return Self::lift(value);
        }
        Self { value, coefficient: through(slope, self.coefficient), ..self }
    }

    #[inline]
    fn binary(self, other: Self, value: f64, [da, db]: [f64; 2]) -> Self {
        match (self.is_constant(), other.is_constant()) {
            (_, true) => self.unary(value, da),
            (true, false) => other.unary(value, db),
            (false, false) => {
                if self.node == other.node && self.recording == other.recording {
                    let coefficient =
                        through(da, self.coefficient) + through(db, other.coefficient);
                    return Self { value, coefficient, ..self };
                }
                with_tape(|tape| tape.push(value, [(self, da), (other, db)]))
            }
        }
    }
}

impl_real_field!([] Var);
