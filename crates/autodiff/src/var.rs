//! Reverse mode: a number that remembers where on the tape it came from.

use crate::chain::{Chain, unless_still};
use crate::local::sum_local;
use crate::real_field::impl_real_field;
use crate::recompute::recompute;
use crate::tape::{push, push_block, push_custom, refuse_foreign};
use crate::{LocalFunction, Recompute, Scalar};

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

    /// The result of an operation on two numbers with the same node.
    #[inline(always)]
    fn fuse(self, other: Self, value: f64, [da, db]: [f64; 2]) -> Self {
        if self.recording != other.recording {
            refuse_foreign();
        }
        let coefficient = unless_still(da, self.coefficient) + unless_still(db, other.coefficient);
        Self { value, coefficient, ..self }
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

impl Chain for Var {
    type Inner = f64;

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

    #[inline(always)]
    fn unary(self, value: f64, slope: f64) -> Self {
        // A constant stays one: its coefficient is never looked at.
        let coefficient = unless_still(slope, self.coefficient);
        Self { value, coefficient, ..self }
    }

    #[inline(always)]
    fn binary(self, other: Self, value: f64, [da, db]: [f64; 2]) -> Self {
        match (self.is_constant(), other.is_constant()) {
            (_, true) => self.unary(value, da),
            (true, false) => other.unary(value, db),
            (false, false) => {
                if self.node == other.node {
                    return self.fuse(other, value, [da, db]);
                }
                push(value, [self, other], [da, db])
            }
        }
    }

    #[inline]
    fn local<const N: usize, const M: usize>(
        function: &impl LocalFunction<N, M>,
        x: [Self; N],
    ) -> [Self; M] {
        let (values, jacobian) = function.linearize(x.map(Self::value));
        let group = match function.reverse_rule() {
            None => push_block(&x, M, jacobian.as_flattened()),
            Some(rule) => push_custom(&x, M, rule),
        };
        std::array::from_fn(|i| group.var(i, values[i]))
    }

    #[inline]
    fn sum_local<const K: usize, F: LocalFunction<K, 1>>(
        x: &[Self],
        terms: impl IntoIterator<Item = (F, [usize; K])>,
    ) -> Self {
        sum_local(x, terms)
    }

    #[inline]
    fn recompute<F: Recompute>(function: F, x: &[Self]) -> Result<Vec<Self>, F::Error> {
        recompute(function, x)
    }
}

impl_real_field!([] Var);
