//! Dense Jacobians by either mode.

use nalgebra::DMatrix;

use crate::fwd::Fwd;
use crate::recording::Recording;
use crate::scalar::Scalar;
use crate::var::Var;

/// Values of `f` at `x` and their Jacobian (outputs × inputs) by reverse mode: one recording, and one
/// sweep for every four outputs.
pub fn jacobian(f: impl FnOnce(&[Var]) -> Vec<Var>, x: &[f64]) -> (Vec<f64>, DMatrix<f64>) {
    let recording = Recording::start();
    let inputs = recording.variables_of(x);
    let outputs = f(&inputs);
    let values = outputs.iter().map(|output| output.value()).collect();
    (values, recording.jacobian(&outputs, &inputs))
}

/// Values of `f` at `x` and their Jacobian (outputs × inputs) by forward mode, along `N` inputs at a time:
/// `f` runs once for every `N` inputs, and once if there are none.
///
/// ```
/// use prehend_autodiff::{Scalar, forward_jacobian};
/// let (values, j) = forward_jacobian::<4>(|x| vec![x[0] * x[1], x[1].times(3.0)], &[2.0, 5.0]);
/// assert_eq!((values, j.as_slice()), (vec![10.0, 15.0], [5.0, 0.0, 2.0, 3.0].as_slice()));
/// ```
///
/// # Panics
/// If `f` does not return the same number of values each time.
pub fn forward_jacobian<const N: usize>(
    mut f: impl FnMut(&[Fwd<N>]) -> Vec<Fwd<N>>,
    x: &[f64],
) -> (Vec<f64>, DMatrix<f64>) {
    const { assert!(N > 0, "at least one direction at a time") };
    let mut inputs: Vec<Fwd<N>> = x.iter().map(|&value| Fwd::constant(value)).collect();
    let (mut values, mut columns) = (Vec::new(), Vec::new());
    for first in (0..x.len().max(1)).step_by(N) {
        let lanes = N.min(x.len() - first);
        for lane in 0..lanes {
            inputs[first + lane] = Fwd::variable(x[first + lane], lane);
        }
        let outputs = f(&inputs);
        assert!(first == 0 || outputs.len() == values.len(), "the number of values changed");
        values = outputs.iter().map(|output| output.value).collect();
        columns.extend((0..lanes).flat_map(|lane| outputs.iter().map(move |y| y.derivative[lane])));
        for lane in 0..lanes {
            inputs[first + lane] = Fwd::constant(x[first + lane]);
        }
    }
    let jacobian = DMatrix::from_vec(values.len(), x.len(), columns);
    (values, jacobian)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polynomials<S: Scalar>(x: &[S]) -> Vec<S> {
        // More outputs than a sweep has lanes; one is a constant, one a fused result.
        (0..7)
            .map(|k| match k {
                5 => S::constant(4.0),
                6 => x[1].times(2.0),
                _ => x.iter().fold(S::one(), |y, x| y * (*x + S::constant(f64::from(k)))),
            })
            .collect()
    }

    #[test]
    fn modes_agree() {
        let x = [0.3, -1.5, 2.0, 0.0, 7.0];
        let (values, reverse) = jacobian(polynomials, &x);
        let (by_pairs, pairs) = forward_jacobian::<2>(polynomials, &x);
        let (by_eights, eights) = forward_jacobian::<8>(polynomials, &x);
        assert_eq!((&values, &values), (&by_pairs, &by_eights));
        assert_eq!(pairs, eights);
        assert!((reverse - pairs).amax() < 1e-12);
    }

    #[test]
    fn functions_of_nothing_have_values() {
        let f = |_: &[Fwd<3>]| vec![Fwd::constant(2.0)];
        assert_eq!(forward_jacobian(f, &[]), (vec![2.0], DMatrix::zeros(1, 0)));
        assert_eq!(jacobian(|_| vec![Var::from(2.0)], &[]).1, DMatrix::zeros(1, 0));
    }

    #[test]
    #[should_panic(expected = "the number of values changed")]
    fn values_that_come_and_go_are_a_mistake() {
        let mut calls = 0;
        let count = |x: &[Fwd<1>]| {
            calls += 1;
            x[..calls].to_vec()
        };
        let _ = forward_jacobian(count, &[1.0, 2.0]);
    }
}
