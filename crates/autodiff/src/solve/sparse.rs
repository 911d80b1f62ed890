//! Gaussian elimination of sparse matrices, by faer.

use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::LuError;
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{CreationError, SparseColMat, Triplet};
use faer::{Conj, MatMut, Par};
use nalgebra::DMatrix;

use super::SolveError;
use super::factored::Factored;
use super::factors::Factors;

/// Factorizes, with partial pivoting, the matrix with these entries (row, column, value), of which those that share a place add
/// up.
pub(super) fn lu(size: usize, entries: &[(usize, usize, f64)]) -> Result<Factored, SolveError> {
    Factored::new(size, entries.iter().copied(), || {
        let triplets: Vec<_> =
            entries.iter().map(|&(row, column, value)| Triplet::new(row, column, value)).collect();
        let matrix = SparseColMat::try_new_from_triplets(size, size, &triplets).map_err(
            |error| match error {
                CreationError::OutOfBounds { row, col } => {
                    SolveError::OutOfBounds { row, column: col, size }
                }
                CreationError::Generic(_) => SolveError::TooLarge,
            },
        )?;
        factorize(&matrix)
    })
}

fn factorize(matrix: &SparseColMat<usize, f64>) -> Result<Arc<dyn Factors>, SolveError> {
    let analysis = factorize_symbolic_lu(matrix.symbolic(), Default::default())
        .map_err(|_| SolveError::TooLarge)?;
    let mut numeric = NumericLu::new();
    let scratch = analysis.factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default());
    let mut memory = MemBuffer::try_new(scratch).map_err(|_| SolveError::TooLarge)?;
    let stack = MemStack::new(&mut memory);
    analysis
        .factorize_numeric_lu(&mut numeric, matrix.as_ref(), Par::Seq, stack, Default::default())
        .map_err(|error| match error {
            LuError::SymbolicSingular { .. } => SolveError::Singular { condition: f64::INFINITY },
            LuError::Generic(_) => SolveError::TooLarge,
        })?;
    Ok(Arc::new(SparseLu { analysis, numeric }))
}

struct SparseLu {
    analysis: SymbolicLu<usize>,
    numeric: NumericLu<usize, f64>,
}

impl Factors for SparseLu {
    fn solve(&self, rhs: &mut DMatrix<f64>) {
        let scratch = self.analysis.solve_in_place_scratch::<f64>(rhs.ncols(), Par::Seq);
        LuRef::new_unchecked(&self.analysis, &self.numeric).solve_in_place_with_conj(
            Conj::No,
            columns(rhs),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
    }

    fn solve_transpose(&self, rhs: &mut DMatrix<f64>) {
        let scratch = self.analysis.solve_transpose_in_place_scratch::<f64>(rhs.ncols(), Par::Seq);
        LuRef::new_unchecked(&self.analysis, &self.numeric).solve_transpose_in_place_with_conj(
            Conj::No,
            columns(rhs),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
    }
}

/// faer's view of right-hand sides.
fn columns(rhs: &mut DMatrix<f64>) -> MatMut<'_, f64> {
    let (rows, columns) = rhs.shape();
    MatMut::from_column_major_slice_mut(rhs.as_mut_slice(), rows, columns)
}

#[cfg(test)]
mod tests {
    use nalgebra::{DVector, Vector1};

    use super::*;
    use crate::solve::lu as dense_lu;

    type Entries = Vec<(usize, usize, f64)>;

    /// Numbers in (−1, 1), the same on every run.
    fn number(seed: usize) -> f64 {
        (seed as f64 * 12.9898 + 0.5).sin()
    }

    fn dense(size: usize, entries: &[(usize, usize, f64)]) -> DMatrix<f64> {
        let mut a = DMatrix::zeros(size, size);
        entries.iter().for_each(|&(row, column, value)| a[(row, column)] += value);
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
    fn entries(places: &[(usize, usize)]) -> Entries {
        let value = |k: usize, diagonal: bool| number(k) + if diagonal { 6.0 } else { 0.0 };
        let places = places.iter().enumerate();
        places.map(|(k, &(i, j))| (i, j, value(k, i == j))).collect()
    }

    #[test]
    fn solutions_are_those_of_the_dense_solve() {
        // The last is full enough for the factors to be kept in dense blocks.
        let full: Vec<_> = (0..200 * 200).map(|k| (k / 200, k % 200)).collect();
        for (size, places) in [(1, vec![(0, 0)]), (9, grid(3)), (144, grid(12)), (200, full)] {
            let mut entries = entries(&places);
            let shift = |(i, j, value): &mut (usize, usize, f64)| {
                *value += if i == j { size as f64 } else { 0.0 };
            };
            entries.iter_mut().for_each(shift);
            let (ours, theirs) =
                (lu(size, &entries).unwrap(), dense_lu(&dense(size, &entries)).unwrap());
            let b = DMatrix::from_fn(size, 2, |i, c| number(i + 1000 * c));
            for solve in [Factored::solve_in_place, Factored::solve_transpose_in_place] {
                let [mut x, mut expected] = [b.clone(), b.clone()];
                solve(&ours, &mut x);
                solve(&theirs, &mut expected);
                assert!((x - &expected).amax() < 1e-12 * (1.0 + expected.amax()), "{size}");
            }
        }
    }

    #[test]
    fn empty_systems_and_right_hand_sides() {
        assert_eq!(lu(0, &[]).unwrap().solve(&DVector::zeros(0)).unwrap().len(), 0);
        let factored = lu(1, &[(0, 0, 2.0)]).unwrap();
        assert_eq!(factored.solve(&DMatrix::zeros(1, 0)).unwrap().shape(), (1, 0));
        assert!((factored.solve(&Vector1::new(3.0)).unwrap().x - 1.5).abs() < 1e-15);
    }

    #[test]
    fn bad_entries_are_refused() {
        assert_eq!(
            lu(2, &[(0, 0, 1.0), (1, 2, 1.0)]).unwrap_err(),
            SolveError::OutOfBounds { row: 1, column: 2, size: 2 }
        );
        let refused = lu(2, &[(0, 0, 1.0), (1, 1, f64::NAN)]).unwrap_err();
        assert_eq!(refused, SolveError::NotFinite("matrix"));
    }

    #[test]
    fn singular_matrices_are_refused_whatever_their_pattern() {
        let mut singular = 0;
        for seed in 0..400 {
            let size = 1 + seed % 5;
            let count = size + seed % (2 * size * size);
            let pick = |k: usize| (number(1000 * seed + k).abs() * 1e6) as usize;
            let entry = |k: usize| {
                let value = (pick(900 + k) % 5) as f64 - 2.0;
                (pick(2 * k) % size, pick(2 * k + 1) % size, value)
            };
            let entries: Entries = (0..count).map(entry).collect();
            let a = dense(size, &entries);
            let regular = a.determinant().abs() > 0.5;
            assert_eq!(lu(size, &entries).is_ok(), regular, "{a}");
            singular += usize::from(!regular);
        }
        assert!((100..300).contains(&singular), "{singular}");

        // Factors in dense blocks: two equal rows, an empty column, an empty row.
        let (size, full) = (200, (0..200 * 200).map(|k| (k / 200, k % 200)));
        let equal_rows: Entries = full
            .clone()
            .map(|(i, j)| (i, j, number(200 * if i == 7 { 8 } else { i } + j)))
            .collect();
        assert!(matches!(lu(size, &equal_rows), Err(SolveError::Singular { .. })));
        for keep in [|(_, j): &(usize, usize)| *j != 7, |(i, _): &(usize, usize)| *i != 7] {
            let places: Vec<_> = full.clone().filter(keep).collect();
            let refused = lu(size, &entries(&places)).unwrap_err();
            assert!(matches!(refused, SolveError::Singular { .. }), "{refused}");
        }
    }
}
