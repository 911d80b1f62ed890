//! Functions of few numbers, differentiated as a whole.

use crate::fwd::Fwd;
use crate::scalar::Scalar;

/// A function of `N` numbers with `M` results: a rotation, a contact wrench, a term of a sum.
///
/// [`Scalar::local`] applies it. For reverse mode it then costs one block node with a dense `M`×`N`
/// Jacobian, which [`linearize`](Self::linearize) finds by forward mode unless it is overridden with
/// something faster:
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
///     fn linearize(&self, [x]: [f64; 1]) -> ([f64; 1], [[f64; 1]; 1]) {
///         (self.evaluate([x]), [[-self.stiffness * (1.0 + 3.0 * x * x)]])
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

    /// The results and their Jacobian, one row a result.
    #[inline]
    fn linearize(&self, x: [f64; N]) -> ([f64; M], [[f64; N]; M]) {
        let results = self.evaluate(Fwd::<N>::variables(x));
        (results.map(|y| y.value), results.map(|y| y.derivative))
    }
}

impl<const N: usize, const M: usize, F: LocalFunction<N, M>> LocalFunction<N, M> for &F {
    #[inline]
    fn evaluate<S: Scalar>(&self, x: [S; N]) -> [S; M] {
        (**self).evaluate(x)
    }

    #[inline]
    fn linearize(&self, x: [f64; N]) -> ([f64; M], [[f64; N]; M]) {
        (**self).linearize(x)
    }
}
