//! The normal equations that terms add to.

use nalgebra::{DMatrix, DMatrixView, DVector, DVectorView, SMatrix, SVector};

use crate::problem::Block;

/// Gradient and Gauss–Newton Hessian of a sum of terms over the requested blocks.
#[derive(Clone, Debug)]
pub struct Normal {
    blocks: Vec<Block>,
    gradient: DVector<f64>,
    hessian: DMatrix<f64>,
    /// Scratch of [`add_row`](Self::add_row): place and derivative of each parameter of a row.
    entries: Vec<(usize, f64)>,
}

/// What [`Normal::marginalize`] finds.
pub(crate) struct SchurComplement {
    /// The equations of the other blocks.
    pub(crate) rest: Normal,
    /// How much lower the least value is.
    pub(crate) gain: f64,
    /// Logarithm of the determinant of the block's Hessian.
    pub(crate) log_determinant: f64,
}

impl Normal {
    /// Empty equations over `blocks`, in that order.
    pub fn new(blocks: &[Block]) -> Self {
        let n = blocks.iter().map(|b| b.dimension()).sum();
        Self {
            blocks: blocks.to_vec(),
            gradient: DVector::zeros(n),
            hessian: DMatrix::zeros(n, n),
            entries: Vec::new(),
        }
    }

    /// Where the parameters of `block` begin, or `None` if it was not requested.
    pub fn offset(&self, block: Block) -> Option<usize> {
        let position = self.blocks.iter().position(|&b| b == block)?;
        Some(self.blocks[..position].iter().map(|b| b.dimension()).sum())
    }

    /// What is left if the last block, which is of [`Block::SurfacePatches`], takes the value at which the quadratic model of the sum is least.
    /// Beforehand no displacement is likeliest, directions are independent, and the covariance in any one has the inverse `precision`, which is
    /// added. `None` if the least is not determined.
    pub(crate) fn marginalize(&mut self, precision: &DMatrix<f64>) -> Option<SchurComplement> {
        let (last, blocks) = self.blocks.split_last()?;
        let (n, m) = (self.gradient.len() - last.dimension(), last.dimension());
        for c in 0..precision.ncols() {
            for r in 0..precision.nrows() {
                for k in 0..3 {
                    self.hessian[(n + 3 * r + k, n + 3 * c + k)] += precision[(r, c)];
                }
            }
        }
        let factor = self.hessian.view((n, n), (m, m)).clone_owned().cholesky()?;
        let lower = factor.l_dirty();
        let coupling =
            lower.solve_lower_triangular(&self.hessian.view((n, 0), (m, n)).clone_owned())?;
        let pull = lower.solve_lower_triangular(&self.gradient.rows(n, m).clone_owned())?;
        let rest = Self {
            blocks: blocks.to_vec(),
            gradient: self.gradient.rows(0, n) - coupling.tr_mul(&pull),
            hessian: self.hessian.view((0, 0), (n, n)) - coupling.tr_mul(&coupling),
            entries: Vec::new(),
        };
        let log_determinant = 2.0 * lower.diagonal().iter().map(|d| d.ln()).sum::<f64>();
        Some(SchurComplement { rest, gain: 0.5 * pull.norm_squared(), log_determinant })
    }

    /// Leaves the first `blocks` only, as if the others were fixed.
    pub(crate) fn truncate(&mut self, blocks: &[Block]) {
        let n = blocks.iter().map(|b| b.dimension()).sum();
        if n < self.gradient.len() {
            self.blocks.truncate(blocks.len());
            self.gradient = self.gradient.rows(0, n).clone_owned();
            self.hessian = self.hessian.view((0, 0), (n, n)).clone_owned();
        }
    }

    /// Derivative of the sum with respect to the requested parameters.
    pub fn gradient(&self) -> &DVector<f64> {
        &self.gradient
    }

    /// Gauss–Newton approximation of the second derivative: symmetric, positive semi-definite.
    pub fn hessian(&self) -> &DMatrix<f64> {
        &self.hessian
    }

    /// The requested blocks, in order.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Adds what half the square of `residual`, times `weight`, brings; `row` has its derivatives by some blocks.
    ///
    /// Parts that belong to blocks nobody requested are dropped.
    pub fn add_row(&mut self, row: &[(Block, &[f64])], residual: f64, weight: f64) {
        self.entries.clear();
        for &(block, derivatives) in row {
            if let Some(offset) = self.offset(block) {
                self.entries.extend(derivatives.iter().enumerate().map(|(i, &d)| (offset + i, d)));
            }
        }
        for &(i, d) in &self.entries {
            self.gradient[i] += weight * residual * d;
            let column = &mut self.hessian.column_mut(i);
            for &(j, e) in &self.entries {
                column[j] += weight * d * e;
            }
        }
    }

    /// Adds half the squares of a block's parameters from a place, given each one's (difference, weight).
    pub fn add_diagonal(&mut self, block: Block, parameters: &[(f64, f64)]) {
        let Some(offset) = self.offset(block) else { return };
        for (i, (difference, weight)) in parameters.iter().enumerate() {
            self.gradient[offset + i] += weight * difference;
            self.hessian[(offset + i, offset + i)] += weight;
        }
    }

    /// Adds the gradient and Hessian of a term whose parameters are those of `blocks`, concatenated.
    ///
    /// Parts that belong to blocks nobody requested are dropped.
    pub fn add<const N: usize>(
        &mut self,
        blocks: &[Block],
        gradient: &SVector<f64, N>,
        hessian: &SMatrix<f64, N, N>,
    ) {
        self.add_views(blocks, &gradient.as_view(), &hessian.as_view());
    }

    /// The same of blocks whose size is not known beforehand.
    ///
    /// # Panics
    /// If there are fewer numbers than the blocks have.
    pub fn add_dynamic(
        &mut self,
        blocks: &[Block],
        gradient: &DVector<f64>,
        hessian: &DMatrix<f64>,
    ) {
        self.add_views(blocks, &gradient.as_view(), &hessian.as_view());
    }

    fn add_views(
        &mut self,
        blocks: &[Block],
        gradient: &DVectorView<f64>,
        hessian: &DMatrixView<f64>,
    ) {
        let mut local = 0;
        let places: Vec<(usize, usize, usize)> = blocks
            .iter()
            .filter_map(|&b| {
                let from = local;
                local += b.dimension();
                self.offset(b).map(|to| (from, to, b.dimension()))
            })
            .collect();
        for &(row_from, row_to, rows) in &places {
            for r in 0..rows {
                self.gradient[row_to + r] += gradient[row_from + r];
            }
            for &(column_from, column_to, columns) in &places {
                for r in 0..rows {
                    for c in 0..columns {
                        self.hessian[(row_to + r, column_to + c)] +=
                            hessian[(row_from + r, column_from + c)];
                    }
                }
            }
        }
    }
}

impl std::ops::AddAssign<&Self> for Normal {
    /// Adds equations over the same blocks, or the first of them.
    fn add_assign(&mut self, other: &Self) {
        let n = other.gradient.len();
        let mut gradient = self.gradient.rows_mut(0, n);
        gradient += &other.gradient;
        let mut hessian = self.hessian.view_mut((0, 0), (n, n));
        hessian += &other.hessian;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_land_in_their_blocks() {
        let mut normal = Normal::new(&[Block::HandPose, Block::ObjectPose]);
        let gradient = SVector::<f64, 12>::from_fn(|r, _| r as f64);
        let hessian = SMatrix::<f64, 12, 12>::from_fn(|r, c| (r * 100 + c) as f64);
        normal.add(&[Block::ObjectPose, Block::HandPose], &gradient, &hessian);
        assert_eq!((normal.gradient()[0], normal.gradient()[6]), (6.0, 0.0));
        assert_eq!(normal.hessian()[(0, 7)], 601.0);

        let mut pose_only = Normal::new(&[Block::ObjectPose]);
        pose_only.add(&[Block::HandPose, Block::ObjectPose], &gradient, &hessian);
        assert_eq!((pose_only.gradient()[0], pose_only.hessian()[(0, 1)]), (6.0, 607.0));
    }
}
