//! Normal equations taken apart.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Cholesky's factor of a symmetric matrix whose parameters have units of their own: its diagonal is scaled to one first.
pub(crate) struct ScaledCholesky {
    factor: Cholesky<f64, Dyn>,
    scale: DVector<f64>,
}

impl ScaledCholesky {
    /// Cholesky factor of `matrix` + `ridge` · diag(`matrix`); `None` if that is not positive definite.
    pub(crate) fn new(matrix: &DMatrix<f64>, ridge: f64) -> Option<Self> {
        let (scaled, scale) = jacobi_scaled(matrix);
        let n = scale.len();
        let factor = (scaled + DMatrix::identity(n, n) * ridge).cholesky()?;
        Some(Self { factor, scale })
    }

    /// The inverse of the matrix.
    pub(crate) fn inverse(&self) -> DMatrix<f64> {
        let mut inverse = self.factor.inverse();
        for r in 0..inverse.nrows() {
            for c in 0..inverse.ncols() {
                inverse[(r, c)] *= self.scale[r] * self.scale[c];
            }
        }
        inverse
    }

    /// Logarithm of the determinant of the matrix.
    pub(crate) fn log_determinant(&self) -> f64 {
        let root: f64 = self.factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        2.0 * root - 2.0 * self.scale.iter().map(|s| s.ln()).sum::<f64>()
    }

    /// Whitening matrix L⁻¹ of this covariance L Lᵀ: whitened deviations are independent and of unit variance. `None` if L is singular.
    pub(crate) fn whitener(&self) -> Option<DMatrix<f64>> {
        let lower = self.factor.l();
        let mut whitener = lower.solve_lower_triangular(&DMatrix::from_diagonal(&self.scale))?;
        // The solve may leave rounding above the diagonal.
        whitener.fill_upper_triangle(0.0, 1);
        Some(whitener)
    }

    /// gᵀ H⁻¹ g of a `gradient` g.
    pub(crate) fn mahalanobis_squared(&self, gradient: &DVector<f64>) -> f64 {
        let gradient = gradient.component_mul(&self.scale);
        gradient.dot(&self.factor.solve(&gradient))
    }
}

/// `matrix` with its diagonal scaled to one, and what its rows and columns were multiplied by.
pub(super) fn jacobi_scaled(matrix: &DMatrix<f64>) -> (DMatrix<f64>, DVector<f64>) {
    let scale = matrix.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 1.0 });
    let n = scale.len();
    (DMatrix::from_fn(n, n, |r, c| matrix[(r, c)] * scale[r] * scale[c]), scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_what_the_plain_matrix_gives() {
        // Units that differ by six orders of magnitude.
        let root = DMatrix::from_row_slice(3, 3, &[1e3, 0.0, 0.0, 0.5, 2e-3, 0.0, 3.0, 1e-3, 4.0]);
        let matrix = &root * root.transpose();
        let factor = ScaledCholesky::new(&matrix, 0.0).unwrap();
        let unit = factor.inverse() * &matrix - DMatrix::identity(3, 3);
        assert!(unit.amax() < 1e-6, "{unit}");
        let expected = 2.0 * (1e3f64 * 2e-3 * 4.0).ln();
        assert!((factor.log_determinant() - expected).abs() < 1e-9);
        let gradient = DVector::from_vec(vec![1.0, -2.0, 0.5]);
        let expected = gradient.dot(&(factor.inverse() * &gradient));
        assert!((factor.mahalanobis_squared(&gradient) / expected - 1.0).abs() < 1e-9);
        let whitener = factor.whitener().unwrap();
        let unit = &whitener * &matrix * whitener.transpose() - DMatrix::identity(3, 3);
        assert!(unit.amax() < 1e-6, "{unit}");
        assert!(ScaledCholesky::new(&-matrix, 0.0).is_none());
    }
}
