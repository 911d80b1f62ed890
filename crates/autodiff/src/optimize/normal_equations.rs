//! Gauss and Newton's quadratic model of a sum of squares.

use nalgebra::{DMatrix, DVector};

use super::problem::QuadraticModel;
use crate::{Fwd, forward_jacobian};

/// The value ½‖r‖² of a least-squares problem at a point, with its derivatives as far as the Jacobian J
/// of the residuals r gives them.
///
/// The fields may also be summed up piece by piece, from blocks of residuals or from sensors, without
/// ever holding J. Forming JᵀJ squares the condition of J: of directions that move the residuals 10⁸
/// times less than others (after each parameter is scaled to its own effect) nothing can be learnt.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalEquations {
    /// ½‖r‖².
    pub value: f64,
    /// Jᵀr, shape \[parameters\].
    pub gradient: DVector<f64>,
    /// JᵀJ, shape \[parameters, parameters\]; of this symmetric matrix the lower triangle is read.
    pub matrix: DMatrix<f64>,
}

impl NormalEquations {
    /// From residuals and their Jacobian, shape \[residuals, parameters\].
    ///
    /// # Panics
    /// If `jacobian` does not have as many rows as there are residuals.
    pub fn from_jacobian(residuals: &[f64], jacobian: &DMatrix<f64>) -> Self {
        assert_eq!(jacobian.nrows(), residuals.len(), "rows of the Jacobian");
        let residuals = DVector::from_column_slice(residuals);
        Self {
            value: 0.5 * residuals.norm_squared(),
            gradient: jacobian.tr_mul(&residuals),
            matrix: jacobian.tr_mul(jacobian),
        }
    }

    /// From the residuals alone, differentiated in forward mode along `N` parameters at a time:
    /// `residuals` runs once for every `N` parameters, rounded up.
    ///
    /// # Panics
    /// If `residuals` does not return the same number of residuals each time.
    pub fn forward<const N: usize>(
        residuals: impl FnMut(&[Fwd<N>]) -> Vec<Fwd<N>>,
        x: &[f64],
    ) -> Self {
        let (values, jacobian) = forward_jacobian(residuals, x);
        Self::from_jacobian(&values, &jacobian)
    }
}

impl QuadraticModel for NormalEquations {
    fn value(&self) -> f64 {
        self.value
    }

    fn gradient(&self) -> &DVector<f64> {
        &self.gradient
    }

    fn hessian(&self) -> &DMatrix<f64> {
        &self.matrix
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_problems::{half_square, powell};
    use super::*;
    use crate::check::{finite_difference_gradient, finite_difference_jacobian};

    #[test]
    fn every_number_of_lanes_agrees_with_differences() {
        let x = [3.0, -1.0, 0.5, 1.0];
        let rows = finite_difference_jacobian(powell, &x, 1e-3);
        let jacobian = DMatrix::from_fn(4, 4, |r, c| rows[r][c]);
        let gradient = finite_difference_gradient(|x| half_square(powell(x)), &x, 1e-3);
        for equations in [
            NormalEquations::forward::<1>(powell, &x),
            NormalEquations::forward::<3>(powell, &x),
            NormalEquations::forward::<4>(powell, &x),
            NormalEquations::forward::<9>(powell, &x),
            NormalEquations::from_jacobian(&powell(&x), &jacobian),
        ] {
            assert!((equations.value - half_square(powell(&x))).abs() < 1e-12 * equations.value);
            let scale = equations.matrix.amax();
            assert!((equations.matrix - jacobian.tr_mul(&jacobian)).amax() < 1e-8 * scale);
            for (g, d) in equations.gradient.iter().zip(&gradient) {
                assert!((g - d).abs() < 1e-8 * equations.gradient.amax(), "{g} {d}");
            }
        }
    }

    #[test]
    fn no_residuals_are_a_minimum_everywhere() {
        let equations = NormalEquations::forward::<2>(|_| Vec::new(), &[1.0, 2.0, 3.0]);
        assert_eq!(equations.value, 0.0);
        assert_eq!(equations.matrix, DMatrix::zeros(3, 3));
    }
}
