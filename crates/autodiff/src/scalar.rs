//! The one scalar trait that simulation code is generic over, and the functions that a scalar may differentiate as a whole.

use nalgebra::{DMatrix, RealField};
use rayon::prelude::*;

use crate::lanes;
use crate::solve::Factored;
use crate::vjp::CustomVjp;

/// A real number that may carry derivatives.
///
/// Code written over `S: Scalar` runs unchanged with `f32`, `f64`, forward-mode [`Fwd`](crate::Fwd)
/// and reverse-mode [`Var`](crate::Var), inside every nalgebra type.
///
/// Plain numbers enter through `S::constant`: write `x.times(2.0)` and `x.plus(1.0)`, or `x * S::constant(2.0)`, neither `2.0 * x` nor `x * 2.0`. Functions
/// such as `cos` of a `Var` or `Fwd` outside of generic code want `use nalgebra::ComplexField`.
///
/// Branches: compare values (`<`, `>` and `==` look at nothing else) and choose with nalgebra's
/// `if_true.select(condition, if_false)`. Unlike multiplying by 0 or 1, the branch not taken then
/// contributes no derivative, so an infinite or NaN slope there cannot leak in as `0 · ∞`.
///
/// At points without a derivative `abs` and `copysign` have slope 0, as has `hypot` at (0, 0); `min` and `max`
/// follow the first operand on a tie; rounding has slope 0. At the edge of its domain a function has the slope
/// from inside, which may be infinite. Derivatives are NaN where there are none at all: those of `atan2` at (0, 0), and of
/// `powf` by the exponent at a negative base. Elsewhere a finite value has no NaN among its first derivatives; what is beyond the range
/// of `f64`, such as the slope 1/x of a logarithm at a subnormal number, is infinite.
pub trait Scalar: RealField + Copy + Default {
    /// Order of the derivatives that it carries: 0 for plain numbers, 1 for one mode, 2 for forward mode over another mode.
    ///
    /// An operation that brings its own first derivatives cannot serve numbers of a higher order, and should refuse
    /// them when it is compiled: `const { assert!(S::ORDER <= 1) }`.
    const ORDER: usize;

    /// Whether numbers belong to a recording, and so to one thread.
    #[doc(hidden)]
    const RECORDED: bool = false;

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

    /// `function` of `x`: plain generic code for most scalars; for [`Var`](crate::Var) one node that keeps only `x`,
    /// whose inside the sweep computes again.
    ///
    /// # Errors
    /// If the function has no results.
    #[inline]
    fn recompute<F: Recompute>(function: F, x: &[Self]) -> Result<Vec<Self>, F::Error> {
        function.evaluate(x)
    }

    /// [`Scalar::recompute`] of each function with numbers of its own, side by side on the threads of `rayon`. Results and
    /// derivatives are the same, to the last bit, for any number of threads.
    ///
    /// Reverse mode records one node for all, and the sweep goes through them side by side as well; one whose results do not
    /// matter is left out. Forward mode over reverse mode takes one function after the other.
    ///
    /// ```
    /// use std::convert::Infallible;
    /// use prehend_autodiff::{Recompute, Scalar, gradient};
    ///
    /// struct Power(i32);
    ///
    /// impl Recompute for Power {
    ///     type Error = Infallible;
    ///     fn evaluate<S: Scalar>(&self, x: &[S]) -> Result<Vec<S>, Infallible> {
    ///         Ok(vec![x[0].powi(self.0)])
    ///     }
    /// }
    ///
    /// let (sum, slope) = gradient(
    ///     |x| {
    ///         let powers = Scalar::recompute_each((1..=3).map(|i| (Power(i), vec![x[0]])).collect());
    ///         powers.into_iter().flatten().flatten().fold(x[0].times(0.0), |sum, y| sum + y)
    ///     },
    ///     &[2.0],
    /// );
    /// assert_eq!((sum, slope[0]), (14.0, 17.0));
    /// ```
    fn recompute_each<F>(functions: Vec<(F, Vec<Self>)>) -> Vec<Result<Vec<Self>, F::Error>>
    where
        F: Recompute + Send + Sync,
        F::Error: Send,
    {
        let apply = |(function, x): (F, Vec<Self>)| Self::recompute(function, &x);
        match Self::RECORDED {
            true => functions.into_iter().map(apply).collect(),
            false => functions.into_par_iter().map(apply).collect(),
        }
    }

    /// `outputs` as results of `operation` on `inputs`, on a recording; none of scalars that are not recorded themselves.
    #[doc(hidden)]
    fn recorded(
        _inputs: &[Self],
        _outputs: &[f64],
        _operation: impl CustomVjp,
    ) -> Option<Vec<Self>> {
        None
    }

    /// A⁻¹ b for a matrix A of plain numbers, which has as many rows as `b`: in reverse mode one node for all.
    ///
    /// ```
    /// use nalgebra::Matrix2;
    /// use prehend_autodiff::solve::{SolveError, lu};
    /// use prehend_autodiff::{Scalar, gradient};
    ///
    /// let matrix = lu(&Matrix2::new(2.0, 1.0, 0.0, 4.0))?;
    /// let (x, slopes) = gradient(|b| Scalar::solve(&matrix, b)[0], &[5.0, 4.0]);
    /// assert_eq!((x, slopes), (2.0, vec![0.5, -0.125]));
    /// # Ok::<(), SolveError>(())
    /// ```
    ///
    /// # Panics
    /// If `b` has another number of rows.
    fn solve(matrix: &Factored, b: &[Self]) -> Vec<Self> {
        let mut x = DMatrix::from_iterator(b.len(), 1, b.iter().map(|b| b.value()));
        matrix.solve_in_place(&mut x);
        x.iter().map(|x| Self::constant(*x)).collect()
    }

    /// Whether this is the constant 0, which moves in no direction.
    fn is_constant_zero(self) -> bool;

    /// Whether no derivative passes through this number.
    fn is_constant(self) -> bool;

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

/// A function of `N` numbers with `M` results: a rotation, a contact wrench, a term of a sum.
///
/// [`Scalar::local`] applies it. For reverse mode it then costs one block node with a dense `M`×`N`
/// Jacobian, found by forward mode unless [`linearize`](Self::linearize) has something faster:
///
/// ```
/// use prehend_autodiff::{LocalFunction, Scalar, gradient};
///
/// /// Force of a spring that hardens as it is stretched.
/// struct Spring {
///     stiffness: f64,
/// }
///
/// impl LocalFunction<1, 1> for Spring {
///     fn evaluate<S: Scalar>(&self, [x]: [S; 1]) -> [S; 1] {
///         [(x + x.powi(3)).times(-self.stiffness)]
///     }
///
///     fn linearize(&self, [x]: [f64; 1]) -> Option<([f64; 1], [[f64; 1]; 1])> {
///         Some((self.evaluate([x]), [[-self.stiffness * (1.0 + 3.0 * x * x)]]))
///     }
/// }
///
/// let spring = Spring { stiffness: 2.0 };
/// let (force, slope) = gradient(|x| Scalar::local(&spring, [x[0]])[0], &[2.0]);
/// assert_eq!((force, slope[0]), (-20.0, -26.0));
/// ```
pub trait LocalFunction<const N: usize, const M: usize> {
    /// The results.
    fn evaluate<S: Scalar>(&self, x: [S; N]) -> [S; M];

    /// The results and their Jacobian, one row a result, where there is a faster way to them than forward mode.
    #[inline]
    fn linearize(&self, _x: [f64; N]) -> Option<([f64; M], [[f64; N]; M])> {
        None
    }

    /// The results and their derivatives along a `direction` of `x`, where there is a faster way to them than by
    /// [`evaluate`](Self::evaluate): what [`Fwd<1>`](crate::Fwd) needs.
    #[inline]
    fn derivative_along(&self, _x: [f64; N], _direction: [f64; N]) -> Option<([f64; M], [f64; M])> {
        None
    }
}

impl<const N: usize, const M: usize, F: LocalFunction<N, M>> LocalFunction<N, M> for &F {
    #[inline]
    fn evaluate<S: Scalar>(&self, x: [S; N]) -> [S; M] {
        (**self).evaluate(x)
    }

    #[inline]
    fn linearize(&self, x: [f64; N]) -> Option<([f64; M], [[f64; N]; M])> {
        (**self).linearize(x)
    }

    #[inline]
    fn derivative_along(&self, x: [f64; N], direction: [f64; N]) -> Option<([f64; M], [f64; M])> {
        (**self).derivative_along(x, direction)
    }
}

/// A function of many numbers, such as a step of a simulation, written once for all scalars.
///
/// [`Scalar::recompute`] applies it. Reverse mode then records one node that keeps the numbers the function was
/// given, and records what is inside only in the sweep, for as long as it takes to go back through it:
///
/// ```
/// use std::convert::Infallible;
/// use prehend_autodiff::{Recompute, Recording, Scalar};
///
/// /// The logistic map, many times.
/// struct Map {
///     times: usize,
/// }
///
/// impl Recompute for Map {
///     type Error = Infallible;
///     fn evaluate<S: Scalar>(&self, x: &[S]) -> Result<Vec<S>, Infallible> {
///         let step = |y: S, _| x[1] * y * (S::one() - y);
///         Ok(vec![(0..self.times).fold(x[0], step)])
///     }
/// }
///
/// let recording = Recording::start();
/// let [x, rate] = recording.variables([0.3, 2.5]);
/// let Ok(y) = Scalar::recompute(Map { times: 100 }, &[x, rate]);
/// assert_eq!(recording.statistics().nodes, 3);
/// // The fixed point is 1 − 1/rate.
/// assert!((recording.gradient(y[0]).wrt(rate) - 1.0 / 6.25).abs() < 1e-12);
/// ```
pub trait Recompute: 'static {
    /// Why there are no results.
    type Error;

    /// The results. It is called again with the same numbers in the sweep, so they may depend on nothing
    /// that changes; should it fail only there, derivatives are NaN.
    ///
    /// # Errors
    /// If there are no results.
    fn evaluate<S: Scalar>(&self, x: &[S]) -> Result<Vec<S>, Self::Error>;
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

            #[inline]
            fn is_constant(self) -> bool {
                true
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
