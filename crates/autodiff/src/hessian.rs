//! Second derivatives: forward mode over reverse mode.

use nalgebra::DMatrix;

use crate::fwd::Fwd;
use crate::recording::Recording;
use crate::scalar::Scalar;
use crate::var::Var;

/// Columns of the Hessian that one recording carries.
const LANES: usize = 4;

/// A number with derivatives along `N` directions, on the tape: what [`hessian`] and [`hessian_vector`] run
/// a function with.
pub type HessianScalar<const N: usize> = Fwd<N, Var>;

/// Value, gradient and Hessian of `f` at `x`.
///
/// Costs a quarter of a recording and sweep of `f` (with four derivatives in each number) for every input. For
/// up to about ten inputs `Fwd<N, Fwd<N>>` needs no tape.
///
/// ```
/// use prehend_autodiff::{Scalar, hessian};
/// fn f<S: Scalar>(x: &[S]) -> S {
///     x[0] * x[0] * x[1]
/// }
/// let (value, gradient, h) = hessian(f, &[3.0, 5.0]);
/// assert_eq!((value, gradient), (45.0, vec![30.0, 9.0]));
/// assert_eq!(h.as_slice(), [10.0, 6.0, 6.0, 0.0]);
/// ```
pub fn hessian(
    f: impl Fn(&[HessianScalar<LANES>]) -> HessianScalar<LANES>,
    x: &[f64],
) -> (f64, Vec<f64>, DMatrix<f64>) {
    let mut gradient = vec![0.0; x.len()];
    let mut hessian = DMatrix::zeros(x.len(), x.len());
    let mut value = 0.0;
    for start in (0..x.len().max(1)).step_by(LANES) {
        let recording = Recording::start();
        let variables = recording.variables_of(x);
        let inputs: Vec<_> = variables
            .iter()
            .enumerate()
            .map(|(i, &value)| match i.checked_sub(start) {
                Some(lane) if lane < LANES => Fwd::variable(value, lane),
                _ => Fwd { value, derivative: [Var::default(); LANES] },
            })
            .collect();
        let output = f(&inputs);
        value = output.value();
        let lanes = LANES.min(x.len() - start);
        let slopes = &output.derivative[..lanes];
        slopes.iter().zip(&mut gradient[start..]).for_each(|(slope, g)| *g = slope.value());
        hessian.rows_mut(start, lanes).copy_from(&recording.jacobian(slopes, &variables));
    }
    (value, gradient, hessian)
}

/// Value and gradient of `f` at `x`, and the product of its Hessian with `direction`, for the price of a
/// few gradients whatever the number of inputs.
///
/// # Panics
/// If `direction` is not as long as `x`.
pub fn hessian_vector(
    f: impl FnOnce(&[HessianScalar<1>]) -> HessianScalar<1>,
    x: &[f64],
    direction: &[f64],
) -> (f64, Vec<f64>, Vec<f64>) {
    assert_eq!(x.len(), direction.len(), "length of the direction");
    let recording = Recording::start();
    let variables = recording.variables_of(x);
    let moving = variables.iter().zip(direction);
    let inputs: Vec<_> =
        moving.map(|(&value, &d)| Fwd { value, derivative: [Var::from(d)] }).collect();
    let output = f(&inputs);
    let rows = recording.jacobian(&[output.value, output.derivative[0]], &variables);
    let [gradient, product] = [0, 1].map(|row| rows.row(row).iter().copied().collect());
    (output.value(), gradient, product)
}

#[cfg(test)]
mod tests {
    use nalgebra::{ComplexField, DVector, Vector3};

    use super::*;
    use crate::check::finite_difference_jacobian;
    use crate::lie;
    use crate::recording::gradient;

    fn energy<S: Scalar>(x: &[S]) -> S {
        let rotation = lie::so3_exp(&Vector3::new(x[0], x[1], x[2]));
        let p = rotation * Vector3::new(x[3], x[4], S::constant(0.3));
        (p.x * p.y).exp() + p.z.sin() * x[4].sqrt() + x[0].atan2(x[3])
    }

    const POINTS: [[f64; 5]; 2] = [[0.3, -0.4, 0.5, 0.7, 1.2], [0.0, 0.0, 0.0, 1.0, 2.0]];

    #[test]
    fn hessians_match_differences_of_gradients_and_nested_forward_mode() {
        for x in POINTS {
            let (value, slope, h) = hessian(energy, &x);
            let (expected_value, expected_slope) = gradient(energy, &x);
            assert_eq!(value, expected_value);
            let differences = finite_difference_jacobian(|x| gradient(energy, x).1, &x, 1e-4);
            let nested = energy(&Fwd::<5, Fwd<5>>::variables(Fwd::<5>::variables(x)));
            for r in 0..5 {
                assert!((slope[r] - expected_slope[r]).abs() < 1e-14);
                for c in 0..5 {
                    assert!((h[(r, c)] - differences[r][c]).abs() < 1e-8, "{r} {c} at {x:?}");
                    let second = nested.derivative[r].derivative[c];
                    assert!((h[(r, c)] - second).abs() < 1e-12, "{r} {c} at {x:?}");
                }
            }
        }
    }

    #[test]
    fn products_are_those_of_the_hessian() {
        let direction = [0.5, -1.0, 2.0, 0.0, 3.0];
        for x in POINTS {
            let (_, slope, h) = hessian(energy, &x);
            let (_, gradient, product) = hessian_vector(energy, &x, &direction);
            let expected = h * DVector::from_row_slice(&direction);
            for i in 0..5 {
                assert!((gradient[i] - slope[i]).abs() < 1e-14);
                assert!((product[i] - expected[i]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn slopes_that_vanish_keep_their_own_slope() {
        // The first derivative of x² is zero at 0, the second is not.
        let (_, gradient, h) = hessian(|x| x[0] * x[0] * x[1].exp(), &[0.0, 0.0]);
        assert_eq!((gradient, h.as_slice()), (vec![0.0, 0.0], [2.0, 0.0, 0.0, 0.0].as_slice()));
    }

    #[test]
    fn constants_have_no_derivatives() {
        let (value, gradient, h) = hessian(|_| HessianScalar::constant(2.0), &[1.0, 1.0]);
        assert_eq!((value, gradient), (2.0, vec![0.0, 0.0]));
        assert_eq!(h.norm(), 0.0);
        assert_eq!(hessian(|_| HessianScalar::constant(2.0), &[]).0, 2.0);
    }
}
