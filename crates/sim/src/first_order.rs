//! Functions that are long to compile, to first order from their values and derivatives.

use prehend_autodiff::{Fwd, Scalar};

/// A function of `N` numbers at a place: its `M` results, and a row of derivatives for each.
pub(crate) type Linearized<const N: usize, const M: usize> = ([f64; M], [[f64; N]; M]);

/// Values and derivatives of a forward-mode evaluation at the values of its variables.
pub(crate) fn linearized<const N: usize, const M: usize>(results: [Fwd<N>; M]) -> Linearized<N, M> {
    (results.map(|y| y.value), results.map(|y| y.derivative))
}

/// The function with these values and derivatives at the values of `x`.
///
/// A [`LocalFunction`](prehend_autodiff::LocalFunction) that is made of it, and of methods that are not generic, is compiled in this crate, and not
/// again in all programs.
#[inline]
pub(crate) fn first_order<S: Scalar, const N: usize, const M: usize>(
    (values, jacobian): &Linearized<N, M>,
    x: &[S; N],
) -> [S; M] {
    const { assert!(S::ORDER <= 1, "first derivatives only: no nested scalars") };
    std::array::from_fn(|row| {
        let terms = x.iter().zip(&jacobian[row]);
        let add = |sum: S, (x, slope): (&S, &f64)| sum + x.plus(-x.value()).times(*slope);
        terms.fold(S::constant(values[row]), add)
    })
}
