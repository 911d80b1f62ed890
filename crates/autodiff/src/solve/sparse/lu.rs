//! Gaussian elimination of sparse matrices.

use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::LuError;
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Conj, Par};
use nalgebra::DMatrix;

use super::columns;
use crate::solve::SolveError;
use crate::solve::factors::Factors;

pub(super) fn analyze(
    matrix: &SymbolicSparseColMat<usize>,
) -> Result<SymbolicLu<usize>, SolveError> {
    factorize_symbolic_lu(matrix.as_ref(), Default::default()).map_err(|_| SolveError::TooLarge)
}

/// The factors of a matrix of the pattern that was analyzed.
pub(super) fn factorize(
    analysis: Arc<SymbolicLu<usize>>,
    matrix: &SparseColMat<usize, f64>,
) -> Result<Arc<dyn Factors>, SolveError> {
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
    analysis: Arc<SymbolicLu<usize>>,
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
