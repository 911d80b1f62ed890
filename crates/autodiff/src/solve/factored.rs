//! A factorized matrix.

use std::fmt;
use std::sync::Arc;

use nalgebra::allocator::Allocator;
use nalgebra::{DMatrix, DefaultAllocator, Dim, Matrix, OMatrix, RawStorage};

use super::SolveError;
use super::condition;
use super::factors::Factors;

/// A factorized square matrix, to be solved with as often as needed. Cheap to clone.
///
/// Made by [`lu`](super::lu) and [`sparse_lu`](super::sparse_lu).
#[derive(Clone)]
pub struct Factored {
    size: usize,
    factors: Arc<dyn Factors>,
    pub(super) condition: f64,
}

impl Factored {
    /// The matrix of `size` rows and columns with these `entries` (row, column, value), of which those in the same place add up.
    pub(super) fn new(
        size: usize,
        entries: impl Iterator<Item = (usize, usize, f64)> + Clone,
        factorize: impl FnOnce() -> Result<Arc<dyn Factors>, SolveError>,
    ) -> Result<Self, SolveError> {
        if !entries.clone().all(|(.., value)| value.is_finite()) {
            return Err(SolveError::NotFinite("matrix"));
        }
        let factors = factorize()?;
        let condition = condition::estimate(size, entries, factors.as_ref());
        if condition > condition::LARGEST {
            return Err(SolveError::Singular { condition });
        }
        Ok(Self { size, factors, condition })
    }

    /// Rows, and columns, of the matrix.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Solves A x = b for one or more right-hand sides, the columns of `b`.
    ///
    /// # Errors
    /// If `b` does not have as many rows as the matrix, or `b` or x is not finite.
    pub fn solve<R: Dim, C: Dim>(
        &self,
        b: &Matrix<f64, R, C, impl RawStorage<f64, R, C>>,
    ) -> Result<OMatrix<f64, R, C>, SolveError>
    where
        DefaultAllocator: Allocator<R, C>,
    {
        let (rows, columns) = b.shape_generic();
        if rows.value() != self.size {
            return Err(SolveError::Length { expected: self.size, found: rows.value() });
        }
        let mut x = DMatrix::from_iterator(rows.value(), columns.value(), b.iter().copied());
        if !x.iter().all(|b| b.is_finite()) {
            return Err(SolveError::NotFinite("right-hand side"));
        }
        self.factors.solve(&mut x);
        if !x.iter().all(|x| x.is_finite()) {
            return Err(SolveError::NotFinite("solution"));
        }
        Ok(OMatrix::from_iterator_generic(rows, columns, x.iter().copied()))
    }

    /// A⁻¹ `rhs`, finite or not.
    pub(crate) fn solve_in_place(&self, rhs: &mut DMatrix<f64>) {
        self.factors.solve(rhs);
    }

    /// A⁻ᵀ `rhs`, finite or not.
    pub(crate) fn solve_transpose_in_place(&self, rhs: &mut DMatrix<f64>) {
        self.factors.solve_transpose(rhs);
    }
}

impl fmt::Debug for Factored {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Factored")
            .field("size", &self.size)
            .field("condition", &self.condition)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

    use super::*;
    use crate::check::{compare_gradients, finite_difference_gradient};
    use crate::fwd::Fwd;
    use crate::recording::gradient;
    use crate::scalar::Scalar;
    use crate::solve::lu;

    /// Three entries of A and one of b vary, two of A together; the first pivot is zero.
    fn system<S: Scalar>(p: &[S]) -> (Matrix3<S>, Vector3<S>) {
        let c = S::constant;
        let rows = [
            [c(0.0), p[0], p[1] * p[1]],
            [p[1] + c(2.0), c(-0.5), c(1.0)],
            [c(3.0), p[2], p[0] * p[2]],
        ];
        (Matrix3::from_fn(|i, j| rows[i][j]), Vector3::new(c(1.0), p[3], p[3] * p[0]))
    }

    /// A number that depends on all of the solution, and is not linear in it.
    fn mix<S: Scalar>(x: &[S]) -> S {
        x.iter()
            .enumerate()
            .fold(S::zero(), |sum, (k, &x)| sum + (x * S::constant(0.3 * (k as f64 + 1.0))).sin())
    }

    /// As the documentation of the module says.
    fn mixed<S: Scalar>(p: &[S]) -> S {
        let (a, b) = system(p);
        let factored = lu(&a.map(S::value)).unwrap();
        let x = factored.solve(&b.map(S::value)).unwrap().map(S::constant);
        let changes = S::solve(&factored, (a * x - b).as_slice());
        mix((x - Vector3::from_vec(changes)).as_slice())
    }

    #[test]
    fn all_modes_agree_with_differences_and_with_the_plain_solver() {
        for p in [[0.7, -1.1, 0.4, 2.0], [-2.0, 0.3, 1.7, 0.0], [1.0, 0.0, -3.0, -0.6]] {
            let (value, reverse) = gradient(mixed, &p);
            assert_eq!(value, mixed(&p));
            let forward = mixed(&Fwd::<4>::variables(p));
            assert!(compare_gradients(&forward.derivative, &reverse).relative < 1e-13);
            let (a, b) = system(&Fwd::<4>::variables(p));
            let plain = mix(a.lu().solve(&b).unwrap().as_slice());
            assert!(compare_gradients(&plain.derivative, &reverse).relative < 1e-13);
            let differences = finite_difference_gradient(mixed, &p, 1e-4);
            assert!(compare_gradients(&differences, &reverse).relative < 1e-9);
        }
    }

    #[test]
    fn an_empty_system_has_an_empty_solution() {
        let factored = lu(&DMatrix::zeros(0, 0)).unwrap();
        assert_eq!(factored.solve(&DVector::zeros(0)).unwrap().len(), 0);
        let none = lu(&Matrix3::identity()).unwrap().solve(&DMatrix::zeros(3, 0)).unwrap();
        assert_eq!(none.shape(), (3, 0));
    }

    #[test]
    fn bad_right_hand_sides_are_refused() {
        let factored = lu(&Matrix3::identity()).unwrap();
        assert!(matches!(
            factored.solve(&DVector::zeros(2)),
            Err(SolveError::Length { expected: 3, found: 2 })
        ));
        for bad in [f64::NAN, f64::INFINITY] {
            let refused = factored.solve(&Vector3::new(0.0, bad, 0.0));
            assert_eq!(refused, Err(SolveError::NotFinite("right-hand side")));
        }
        let tiny = lu(&(Matrix3::identity() * 1e-200)).unwrap();
        assert_eq!(tiny.solve(&Vector3::repeat(1e200)), Err(SolveError::NotFinite("solution")));
    }
}
