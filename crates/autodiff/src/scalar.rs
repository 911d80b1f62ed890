//! The one scalar trait that simulation code is generic over.

use nalgebra::RealField;

use crate::lanes;
use crate::local::LocalFunction;
use crate::recompute::Recompute;

/// A real number that may carry derivatives.
///
/// Code written over `S: Scalar` runs unchanged with `f32`, `f64`, forward-mode [`Fwd`](crate::Fwd)
/// and reverse-mode [`Var`](crate::Var), inside every nalgebra type.
///
/// Plain numbers enter through `S::constant`: write `x * S::constant(2.0)` or `x.times(2.0)`, not `2.0 * x`.
///
/// Branches: compare values (`<`, `>` and `==` look at nothing else) and choose with nalgebra's
/// `if_true.select(condition, if_false)`. Unlike multiplying by 0 or 1, the branch not taken then
/// contributes no derivative, so an infinite or NaN slope there cannot leak in as `0 · ∞`.
///
/// At points without a derivative `abs` and `copysign` have slope 0, as has `hypot` at (0, 0); `min` and `max`
/// follow the first operand on a tie; rounding has slope 0. At the edge of its domain a function has the slope
/// from inside, which may be infinite.
pub trait Scalar: RealField + Copy + Default {
    /// Of which order the derivatives are that it carries: 0 for plain numbers, 2 for forward mode over another mode.
    ///
    /// An operation that brings its own first derivatives cannot serve numbers of a higher order, and should refuse
    /// them when it is compiled: `const { assert!(S::ORDER <= 1) }`.
    const ORDER: usize;

    /// A constant: carries no derivative.
    fn constant(value: f64) -> Self;

    /// The plain value, without its derivatives.
    fn value(self) -> f64;

    /// `self * factor`: what multiplying by a constant gives, faster in forward mode.
    #[inline]
    fn times(self, factor: f64) -> Self {
        self * Self::constant(factor)
    }

    /// `self + term`: what adding a constant gives, faster in forward mode.
    #[inline]
    fn plus(self, term: f64) -> Self {
        self + Self::constant(term)
    }

    /// `function` of `x`: plain generic code for most scalars; for [`Var`](crate::Var) one block node with
    /// the function's own Jacobian, which is smaller and faster than recording each operation inside.
    #[inline]
    fn local<const N: usize, const M: usize>(
        function: &impl LocalFunction<N, M>,
        x: [Self; N],
    ) -> [Self; M] {
        function.evaluate(x)
    }

    /// The sum of many terms, each a function of `K` of the numbers `x`; every term comes with the places of
    /// its numbers in `x`.
    ///
    /// For [`Var`](crate::Var) the whole sum is one node, whose gradient is added up outside the tape.
    ///
    /// # Panics
    /// If a place is not in `x`.
    #[inline]
    fn sum_local<const K: usize, F: LocalFunction<K, 1>>(
        x: &[Self],
        terms: impl IntoIterator<Item = (F, [usize; K])>,
    ) -> Self {
        add_up(x, terms)
    }

    /// `function` of `x`: plain generic code for most scalars; for [`Var`](crate::Var) one node that keeps only `x`,
    /// whose inside the sweep computes again.
    ///
    /// # Errors
    /// If the function has no results.
    #[inline]
    fn recompute<F: Recompute>(function: F, x: &[Self]) -> Result<Vec<Self>, F::Error> {
        function.evaluate(x)
    }

    /// Whether this is the constant 0, which moves in no direction.
    fn is_constant_zero(self) -> bool;

    /// `self` times each of `derivative`.
    #[doc(hidden)]
    #[inline(always)]
    fn scale_lanes<const N: usize>(self, derivative: [Self; N]) -> [Self; N] {
        derivative.map(|d| self * d)
    }

    /// The sum of `slopes[0]` times `a` and `slopes[1]` times `b`, place by place.
    #[doc(hidden)]
    #[inline(always)]
    fn combine_lanes<const N: usize>(slopes: [Self; 2], a: [Self; N], b: [Self; N]) -> [Self; N] {
        std::array::from_fn(|i| slopes[0] * a[i] + slopes[1] * b[i])
    }
}

/// [`Scalar::sum_local`] as plain generic code.
#[inline]
pub(crate) fn add_up<S: Scalar, const K: usize, F: LocalFunction<K, 1>>(
    x: &[S],
    terms: impl IntoIterator<Item = (F, [usize; K])>,
) -> S {
    let values = terms.into_iter().map(|(term, places)| term.evaluate(places.map(|p| x[p])));
    values.fold(S::zero(), |sum, [value]| sum + value)
}

macro_rules! plain_scalar {
    ($t:ty { $($own:tt)* }) => {
        impl Scalar for $t {
            const ORDER: usize = 0;

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
            fn is_constant_zero(self) -> bool {
                self == 0.0
            }

            $($own)*
        }
    };
}

plain_scalar!(f32 {});
plain_scalar!(f64 {
    #[inline(always)]
    fn scale_lanes<const N: usize>(self, derivative: [Self; N]) -> [Self; N] {
        lanes::scaled(self, derivative)
    }

    #[inline(always)]
    fn combine_lanes<const N: usize>(slopes: [Self; 2], a: [Self; N], b: [Self; N]) -> [Self; N] {
        lanes::combined(slopes, a, b)
    }
});
