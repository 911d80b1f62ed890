//! Dense matrices.

use std::sync::Arc;

use nalgebra::{DMatrix, Dim, Dyn, LU, Matrix, PermutationSequence, RawStorage};

use super::SolveError;
use super::factored::Factored;
use super::factors::Factors;

/// Rows from which on a sparse factorization is faster, with some twenty entries each.
#[cfg(feature = "faer")]
const SPARSE: usize = 120;

/// Factorizes a dense square matrix by Gaussian elimination with partial pivoting.
///
/// # Errors
/// If `a` is not square, holds a number that is not finite, or is singular to working precision.
///
/// # Examples
/// ```
/// use nalgebra::{Matrix2, Vector2};
/// use prehend_autodiff::solve::lu;
/// let x = lu(&Matrix2::new(4.0, 0.0, 0.0, 2.0))?.solve(&Vector2::new(3.0, 1.0))?;
/// assert_eq!(x, Vector2::new(0.75, 0.5));
/// # Ok::<(), prehend_autodiff::solve::SolveError>(())
/// ```
pub fn lu<D: Dim>(
    a: &Matrix<f64, D, D, impl RawStorage<f64, D, D>>,
) -> Result<Factored, SolveError> {
    let (size, columns) = a.shape();
    if size != columns {
        return Err(SolveError::NotSquare { rows: size, columns });
    }
    let a = DMatrix::from_iterator(size, size, a.iter().copied());
    let entries = a.iter().enumerate().map(|(k, value)| (k % size, k / size, *value));
    Factored::new(size, entries, || {
        let (permutation, lower, upper) = LU::new(a.clone()).unpack();
        if upper.diagonal().iter().any(|pivot| *pivot == 0.0) {
            return Err(SolveError::Singular { condition: f64::INFINITY });
        }
        Ok(Arc::new(DenseLu { permutation, lower, upper }))
    })
}

/// Factorizes a matrix of `size` rows and columns that is zero but for these entries (row, column, value), of which those that share
/// a place add up: as a sparse one with the cargo feature `faer`, if it has more than a hundred rows, otherwise as a
/// dense one.
///
/// # Errors
/// If a place lies outside the matrix, a value is not finite, or the matrix is singular to working precision.
pub fn sparse_lu(size: usize, entries: &[(usize, usize, f64)]) -> Result<Factored, SolveError> {
    #[cfg(feature = "faer")]
    if size >= SPARSE {
        return super::sparse::lu(size, entries);
    }
    let mut matrix = DMatrix::zeros(size, size);
    for &(row, column, value) in entries {
        let outside = SolveError::OutOfBounds { row, column, size };
        *matrix.get_mut((row, column)).ok_or(outside)? += value;
    }
    lu(&matrix)
}

/// The factors of P A = L U.
struct DenseLu {
    permutation: PermutationSequence<Dyn>,
    lower: DMatrix<f64>,
    upper: DMatrix<f64>,
}

// nalgebra's triangular solves return whether no diagonal entry is zero, which is known here.
impl Factors for DenseLu {
    fn solve(&self, rhs: &mut DMatrix<f64>) {
        self.permutation.permute_rows(rhs);
        self.lower.solve_lower_triangular_mut(rhs);
        self.upper.solve_upper_triangular_mut(rhs);
    }

    fn solve_transpose(&self, rhs: &mut DMatrix<f64>) {
        self.upper.tr_solve_upper_triangular_mut(rhs);
        self.lower.tr_solve_lower_triangular_mut(rhs);
        self.permutation.inv_permute_rows(rhs);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix2;

    use super::*;

    #[test]
    fn transposed_solves_undo_the_transposed_product() {
        let a = DMatrix::from_fn(9, 9, |i, j| ((5 * i + 3 * j + 1).pow(2) as f64).sin());
        let factored = lu(&a).unwrap();
        let x = DMatrix::from_fn(9, 2, |i, c| (i + 4 * c) as f64 - 3.0);
        let mut back = a.transpose() * &x;
        factored.solve_transpose_in_place(&mut back);
        assert!((&back - &x).amax() < 1e-11, "{back}");
        let mut back = &a * &x;
        factored.solve_in_place(&mut back);
        assert!((&back - &x).amax() < 1e-11, "{back}");
    }

    #[test]
    fn bad_matrices_are_refused() {
        assert_eq!(
            lu(&DMatrix::zeros(2, 3)).unwrap_err(),
            SolveError::NotSquare { rows: 2, columns: 3 }
        );
        for bad in [f64::NAN, f64::NEG_INFINITY] {
            let refused = lu(&Matrix2::new(1.0, bad, 0.0, 1.0));
            assert_eq!(refused.unwrap_err(), SolveError::NotFinite("matrix"));
        }
        let singular = SolveError::Singular { condition: f64::INFINITY };
        assert_eq!(lu(&Matrix2::zeros()).unwrap_err(), singular);
        assert_eq!(lu(&Matrix2::new(1.0, 2.0, 2.0, 4.0)).unwrap_err(), singular);
    }
}
