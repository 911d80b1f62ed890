//! Sparse matrices, factorized by faer.

mod cholesky;
mod lu;

use std::sync::Arc;

use faer::MatMut;
use faer::sparse::linalg::cholesky::SymbolicCholesky;
use faer::sparse::linalg::lu::SymbolicLu;
use faer::sparse::{Argsort, CreationError, Pair, SparseColMat, SymbolicSparseColMat};
use nalgebra::DMatrix;

use super::SolveError;
use super::factored::Factored;
use super::pattern::{Pattern, Place};
use crate::operand::Operand;

/// A factorization prepared for all the matrices that have their entries in the same places.
///
/// Finding the order of elimination and the places that fill in is done once, here; a simulation that
/// changes the values from step to step calls only [`factor`](Self::factor). Runs on one thread, and needs
/// the cargo feature `faer`.
///
/// # Examples
/// A chain of two springs:
/// ```
/// use nalgebra::DVector;
/// use prehend_autodiff::{Operand, gradient, solve::{SolveError, SparseSolver}};
///
/// fn end<S: Operand>(solver: &SparseSolver, k: &[S]) -> Result<S, SolveError> {
///     let x = solver.factor(&[k[0], k[1], -k[1], k[1]])?.solve(&DVector::from_vec(vec![S::zero(), S::one()]))?;
///     Ok(x[1])
/// }
///
/// // Entries that share a place add up; of a symmetric matrix the lower triangle is enough.
/// let solver = SparseSolver::cholesky(2, &[(0, 0), (0, 0), (1, 0), (1, 1)])?;
/// let (value, slopes) = gradient(|k| end(&solver, k).unwrap(), &[4.0, 2.0]);
/// assert!((value - 0.75).abs() < 1e-15);
/// assert!((slopes[0] + 1.0 / 16.0).abs() < 1e-15 && (slopes[1] + 1.0 / 4.0).abs() < 1e-15);
/// # Ok::<(), SolveError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SparseSolver {
    entries: usize,
    pattern: Pattern,
    matrix: SymbolicSparseColMat<usize>,
    order: Argsort<usize>,
    analysis: Analysis,
}

/// Symbolic factorization: the structure of the factors, without their values.
#[derive(Clone, Debug)]
enum Analysis {
    Lu(Arc<SymbolicLu<usize>>),
    Cholesky(Arc<SymbolicCholesky<usize>>),
}

impl SparseSolver {
    /// Prepares LU factorizations, with partial pivoting, of matrices of `size` rows and columns whose
    /// entries stand at `places` (row, column). Entries that share a place add up.
    ///
    /// # Errors
    /// If a place lies outside the matrix, or there is not enough memory.
    pub fn lu(size: usize, places: &[(usize, usize)]) -> Result<Self, SolveError> {
        let standing = places
            .iter()
            .enumerate()
            .map(|(entry, &(row, column))| Place { entry, row, column })
            .collect();
        Self::new(size, places, standing, |matrix| Ok(Analysis::Lu(Arc::new(lu::analyze(matrix)?))))
    }

    /// Prepares Cholesky factorizations of symmetric positive definite matrices of `size` rows and
    /// columns whose entries stand at `places` (row, column). Entries that share a place add up.
    ///
    /// Only entries on and below the diagonal are read, and carry derivatives; an entry below it stands
    /// also for its mirror image. The entries of a full matrix may be given all the same.
    ///
    /// # Errors
    /// If a place lies outside the matrix, or there is not enough memory.
    pub fn cholesky(size: usize, places: &[(usize, usize)]) -> Result<Self, SolveError> {
        let standing = places
            .iter()
            .enumerate()
            .filter(|(_, (row, column))| row >= column)
            .flat_map(|(entry, &(row, column))| {
                let mirrored = Place { entry, row: column, column: row };
                [Some(Place { entry, row, column }), (row != column).then_some(mirrored)]
            })
            .flatten()
            .collect();
        Self::new(size, places, standing, |matrix| {
            Ok(Analysis::Cholesky(Arc::new(cholesky::analyze(matrix)?)))
        })
    }

    fn new(
        size: usize,
        places: &[(usize, usize)],
        standing: Arc<[Place]>,
        analyze: impl FnOnce(&SymbolicSparseColMat<usize>) -> Result<Analysis, SolveError>,
    ) -> Result<Self, SolveError> {
        let pairs: Vec<_> = places.iter().map(|&(row, column)| Pair::new(row, column)).collect();
        let (matrix, order) = SymbolicSparseColMat::try_new_from_indices(size, size, &pairs)
            .map_err(|error| match error {
                CreationError::OutOfBounds { row, col } => {
                    SolveError::OutOfBounds { row, column: col, size }
                }
                CreationError::Generic(_) => SolveError::TooLarge,
            })?;
        let analysis = analyze(&matrix)?;
        let pattern = Pattern::Sparse { size, places: standing };
        Ok(Self { entries: places.len(), pattern, matrix, order, analysis })
    }

    /// Factorizes the matrix with these entries, in the order in which their places were given.
    ///
    /// # Errors
    /// If the number of entries is wrong, one is not finite, or the matrix is singular to working
    /// precision or, for Cholesky, not positive definite.
    pub fn factor<S: Operand>(&self, entries: &[S]) -> Result<Factored<S>, SolveError> {
        if entries.len() != self.entries {
            return Err(SolveError::Length {
                what: "entries",
                expected: self.entries,
                found: entries.len(),
            });
        }
        Factored::new(self.pattern.clone(), entries.to_vec(), |values| {
            let matrix = SparseColMat::new_from_argsort(self.matrix.clone(), &self.order, values)
                .map_err(|_| SolveError::TooLarge)?;
            match &self.analysis {
                Analysis::Lu(analysis) => lu::factorize(analysis.clone(), &matrix),
                Analysis::Cholesky(analysis) => cholesky::factorize(analysis.clone(), &matrix),
            }
        })
    }
}

/// faer's view of right-hand sides.
fn columns(rhs: &mut DMatrix<f64>) -> MatMut<'_, f64> {
    let (rows, columns) = rhs.shape();
    MatMut::from_column_major_slice_mut(rhs.as_mut_slice(), rows, columns)
}

#[cfg(test)]
mod tests {
    use nalgebra::{DVector, Vector1, Vector2};

    use super::*;
    use crate::check::compare_gradients;
    use crate::fwd::Fwd;
    use crate::recording::gradient;
    use crate::scalar::Scalar;
    use crate::solve::lu;
    use crate::var::Var;

    /// Numbers in (−1, 1), the same on every run.
    fn number(seed: usize) -> f64 {
        (seed as f64 * 12.9898 + 0.5).sin()
    }

    /// The matrix with these entries, as a dense one.
    fn dense<S: Operand>(size: usize, places: &[(usize, usize)], entries: &[S]) -> DMatrix<S> {
        let mut a = DMatrix::zeros(size, size);
        for (&place, &entry) in places.iter().zip(entries) {
            a[place] += entry;
        }
        a
    }

    /// A grid of `side` × `side` points, each coupled with its neighbors; some places occur twice.
    fn grid(side: usize) -> Vec<(usize, usize)> {
        let mut places = Vec::new();
        for k in 0..side * side {
            places.push((k, k));
            if k % side + 1 < side {
                places.extend([(k, k + 1), (k + 1, k), (k, k), (k + 1, k + 1)]);
            }
            if k + side < side * side {
                places.extend([(k, k + side), (k + side, k)]);
            }
        }
        places
    }

    /// Not symmetric, but with a large diagonal.
    fn entries(places: &[(usize, usize)]) -> Vec<f64> {
        let entry =
            |(k, (i, j)): (usize, &(usize, usize))| number(k) + if i == j { 6.0 } else { 0.0 };
        places.iter().enumerate().map(entry).collect()
    }

    fn mix<S: Scalar>(x: &DVector<S>) -> S {
        x.iter()
            .enumerate()
            .fold(S::zero(), |sum, (k, &x)| sum + (x * S::constant(number(k))).sin())
    }

    fn right_hand_side<S: Operand>(size: usize, p: &[S]) -> DVector<S> {
        DVector::from_fn(size, |i, _| p[i % p.len()] * p[0] * S::constant(number(i)))
    }

    fn by_sparse<S: Operand>(solver: &SparseSolver, size: usize, p: &[S]) -> S {
        mix(&solver.factor(p).unwrap().solve(&right_hand_side(size, p)).unwrap())
    }

    /// [`by_sparse`] with the dense solver; `mirror` copies the lower triangle to the upper one.
    fn by_dense<S: Operand>(size: usize, places: &[(usize, usize)], mirror: bool, p: &[S]) -> S {
        let mut a = dense(size, places, p);
        if mirror {
            a.fill_upper_triangle_with_lower_triangle();
        }
        mix(&lu(&a).unwrap().solve(&right_hand_side(size, p)).unwrap())
    }

    #[test]
    fn gradients_are_those_of_the_dense_solve() {
        // The last is full enough for the factors to be kept in dense blocks.
        let full: Vec<_> = (0..200 * 200).map(|k| (k / 200, k % 200)).collect();
        for (size, places) in [(1, vec![(0, 0)]), (9, grid(3)), (144, grid(12)), (200, full)] {
            let mut p = entries(&places);
            for symmetric in [false, true] {
                let solver = if symmetric {
                    for (p, (i, j)) in p.iter_mut().zip(&places) {
                        *p += if i == j { size as f64 } else { 0.0 };
                    }
                    SparseSolver::cholesky(size, &places)
                } else {
                    SparseSolver::lu(size, &places)
                }
                .unwrap();
                let (value, ours) = gradient(|p| by_sparse(&solver, size, p), &p);
                let (expected, theirs) = gradient(|p| by_dense(size, &places, symmetric, p), &p);
                assert!((value - expected).abs() < 1e-11 * (1.0 + expected.abs()));
                assert!(compare_gradients(&ours, &theirs).relative < 1e-10, "{size} {symmetric}");
                // Tangents along a direction that all entries share in.
                let along: Vec<f64> = (0..p.len()).map(|k| number(3 * k + 1)).collect();
                let moving: Vec<Fwd<1>> = (p.iter().zip(&along))
                    .map(|(&value, &along)| Fwd { value, derivative: [along] })
                    .collect();
                let forward = by_sparse(&solver, size, &moving).derivative[0];
                let reverse: f64 = ours.iter().zip(&along).map(|(a, b)| a * b).sum();
                assert!((forward - reverse).abs() < 1e-10 * (1.0 + reverse.abs()), "{size}");
            }
        }
    }

    #[test]
    fn one_analysis_serves_many_matrices() {
        let places = grid(4);
        let solver = SparseSolver::lu(16, &places).unwrap();
        let b = DVector::repeat(16, 1.0);
        for shift in 1..4 {
            let values: Vec<f64> = entries(&places).iter().map(|v| v * shift as f64).collect();
            let x = solver.factor(&values).unwrap().solve(&b).unwrap();
            assert!((dense(16, &places, &values) * x - &b).amax() < 1e-13);
        }
    }

    #[test]
    fn empty_systems_and_right_hand_sides() {
        for solver in [SparseSolver::lu(0, &[]), SparseSolver::cholesky(0, &[])] {
            let factored = solver.unwrap().factor::<f64>(&[]).unwrap();
            assert_eq!(factored.solve(&DVector::zeros(0)).unwrap().len(), 0);
        }
        for solver in [SparseSolver::lu(1, &[(0, 0)]), SparseSolver::cholesky(1, &[(0, 0)])] {
            let factored = solver.unwrap().factor(&[2.0_f64]).unwrap();
            assert_eq!(factored.solve(&DMatrix::zeros(1, 0)).unwrap().shape(), (1, 0));
            assert!((factored.solve(&Vector1::new(3.0)).unwrap().x - 1.5).abs() < 1e-15);
        }
    }

    #[test]
    fn bad_patterns_and_entries_are_refused() {
        assert_eq!(
            SparseSolver::lu(2, &[(0, 0), (1, 2)]).unwrap_err(),
            SolveError::OutOfBounds { row: 1, column: 2, size: 2 }
        );
        assert!(SparseSolver::cholesky(2, &[(7, 0)]).is_err());
        let solver = SparseSolver::lu(2, &[(0, 0), (1, 1)]).unwrap();
        assert!(matches!(
            solver.factor(&[1.0]),
            Err(SolveError::Length { expected: 2, found: 1, .. })
        ));
        let refused = solver.factor(&[1.0, f64::NAN]).unwrap_err();
        assert_eq!(refused, SolveError::NotFinite("matrix"));
    }

    #[test]
    fn matrices_that_are_not_positive_definite_are_refused() {
        let solver = SparseSolver::cholesky(2, &[(0, 0), (1, 0), (1, 1)]).unwrap();
        for entries in [[1.0, 2.0, 1.0], [-1.0, 0.0, 1.0], [0.0, 0.0, 0.0]] {
            let refused = solver.factor(&entries).unwrap_err();
            assert!(matches!(refused, SolveError::NotPositiveDefinite { .. }), "{refused}");
        }
        let nearly = solver.factor(&[1.0, 1.0, 1.0 + 1e-15]).unwrap_err();
        assert!(matches!(nearly, SolveError::Singular { .. }), "{nearly}");
        assert!(SparseSolver::cholesky(2, &[(0, 0)]).unwrap().factor(&[1.0]).is_err());
    }

    #[test]
    fn singular_matrices_are_refused_whatever_their_pattern() {
        let mut singular = 0;
        for seed in 0..400 {
            let size = 1 + seed % 5;
            let count = size + seed % (2 * size * size);
            let pick = |k: usize| (number(1000 * seed + k).abs() * 1e6) as usize;
            let places: Vec<_> =
                (0..count).map(|k| (pick(2 * k) % size, pick(2 * k + 1) % size)).collect();
            let values: Vec<f64> = (0..count).map(|k| (pick(900 + k) % 5) as f64 - 2.0).collect();
            let a = dense(size, &places, &values);
            let regular = a.determinant().abs() > 0.5;
            let factored = SparseSolver::lu(size, &places).unwrap().factor(&values);
            assert_eq!(factored.is_ok(), regular, "{a}");
            singular += usize::from(!regular);
        }
        assert!((100..300).contains(&singular), "{singular}");

        // Factors in dense blocks: two equal rows, an empty column, an empty row.
        let (size, full) = (200, (0..200 * 200).map(|k| (k / 200, k % 200)));
        let equal_rows: Vec<f64> =
            full.clone().map(|(i, j)| number(200 * if i == 7 { 8 } else { i } + j)).collect();
        let solver = SparseSolver::lu(size, &full.clone().collect::<Vec<_>>()).unwrap();
        assert!(matches!(solver.factor(&equal_rows), Err(SolveError::Singular { .. })));
        for keep in [|(_, j): &(usize, usize)| *j != 7, |(i, _): &(usize, usize)| *i != 7] {
            let places: Vec<_> = full.clone().filter(keep).collect();
            let solver = SparseSolver::lu(size, &places).unwrap();
            let refused = solver.factor(&entries(&places)).unwrap_err();
            assert!(matches!(refused, SolveError::Singular { .. }), "{refused}");
        }
    }

    #[test]
    fn entries_above_the_diagonal_are_not_read() {
        let places = [(0, 0), (0, 1), (1, 0), (1, 1)];
        let solver = SparseSolver::cholesky(2, &places).unwrap();
        let at = |p: &[Var]| {
            let b = Vector2::new(1.0, 2.0).map(Var::constant);
            solver.factor(p).unwrap().solve(&b).unwrap().x
        };
        let (value, slopes) = gradient(at, &[2.0, 77.0, 0.5, 3.0]);
        assert!((value - (3.0 - 1.0) / 5.75).abs() < 1e-15);
        assert_eq!(slopes[1], 0.0);
        assert!(slopes[2] != 0.0);
    }
}
