//! Arithmetic in reverse mode.

use crate::differentiable::{Differentiable, chain_active};
use crate::real_field::impl_real_field;
use crate::scalar::{LocalFunction, Recompute, Scalar};
use crate::solve::Factored;
use crate::tape::{push, refuse_foreign};
use crate::var::Var;
use crate::vjp::CustomVjp;
use crate::{recomputed, record};

impl Var {
    /// The result of an operation on two numbers with the same node.
    #[inline(always)]
    fn fuse(self, other: Self, value: f64, [da, db]: [f64; 2]) -> Self {
        if self.recording != other.recording {
            refuse_foreign();
        }
        let coefficient = chain_active(da, self.coefficient) + chain_active(db, other.coefficient);
        Self { value, coefficient, ..self }
    }
}

impl Differentiable for Var {
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
        let coefficient = chain_active(slope, self.coefficient);
        Self { value, coefficient, ..self }
    }

    #[inline(always)]
    fn binary(self, other: Self, value: f64, [da, db]: [f64; 2]) -> Self {
        match (Differentiable::is_constant(self), Differentiable::is_constant(other)) {
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
}

impl_real_field!([] Var {
    const RECORDED: bool = true;

    #[inline]
    fn local<const N: usize, const M: usize>(
        function: &impl LocalFunction<N, M>,
        x: [Self; N],
    ) -> [Self; M] {
        record::local(function, x)
    }

    #[inline]
    fn recompute<F: Recompute>(function: F, x: &[Self]) -> Result<Vec<Self>, F::Error> {
        recomputed::recompute(function, x)
    }

    fn recompute_each<F>(functions: Vec<(F, Vec<Self>)>) -> Vec<Result<Vec<Self>, F::Error>>
    where
        F: Recompute + Send + Sync,
        F::Error: Send,
    {
        recomputed::recompute_each(functions)
    }

    fn recorded(
        inputs: &[Self],
        outputs: &[f64],
        operation: impl CustomVjp,
    ) -> Option<Vec<Self>> {
        Some(record::custom(inputs, outputs, operation))
    }

    fn solve(matrix: &Factored, b: &[Self]) -> Vec<Self> {
        record::solve(matrix, b)
    }
});
