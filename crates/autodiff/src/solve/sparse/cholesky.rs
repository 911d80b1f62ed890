//! Cholesky factorization of sparse matrices, of which the lower triangle is read.

use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltError;
use faer::sparse::linalg::cholesky::{LltRef, SymbolicCholesky, factorize_symbolic_cholesky};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Conj, Par, Side};
use nalgebra::DMatrix;

use super::columns;
use crate::solve::SolveError;
use crate::solve::factors::Factors;

pub(super) fn analyze(
    matrix: &SymbolicSparseColMat<usize>,
) -> Result<SymbolicCholesky<usize>, SolveError> {
    let (ordering, blocks) = (Default::default(), Default::default());
    factorize_symbolic_cholesky(matrix.as_ref(), Side::Lower, ordering, blocks)
        .map_err(|_| SolveError::TooLarge)
}

/// The factors of a matrix of the pattern that was analyzed.
pub(super) fn factorize(
    analysis: Arc<SymbolicCholesky<usize>>,
    matrix: &SparseColMat<usize, f64>,
) -> Result<Arc<dyn Factors>, SolveError> {
    let mut numeric = vec![0.0; analysis.len_val()];
    let scratch = analysis.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
    let mut memory = MemBuffer::try_new(scratch).map_err(|_| SolveError::TooLarge)?;
    analysis
        .factorize_numeric_llt(
            &mut numeric,
            matrix.as_ref(),
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        )
        .map_err(|LltError::NonPositivePivot { index: step }| SolveError::NotPositiveDefinite {
            step,
        })?;
    Ok(Arc::new(SparseCholesky { analysis, numeric }))
}

struct SparseCholesky {
    analysis: Arc<SymbolicCholesky<usize>>,
    numeric: Vec<f64>,
}

impl Factors for SparseCholesky {
    fn solve(&self, rhs: &mut DMatrix<f64>) {
        let scratch = self.analysis.solve_in_place_scratch::<f64>(rhs.ncols(), Par::Seq);
        LltRef::new(&self.analysis, &self.numeric).solve_in_place_with_conj(
            Conj::No,
            columns(rhs),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
    }

    fn solve_transpose(&self, rhs: &mut DMatrix<f64>) {
        self.solve(rhs);
    }
}
