//! The normal equations that terms add to.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use crate::Block;

/// Gradient and Gauss–Newton Hessian of a sum of terms over the requested blocks.
#[derive(Clone, Debug)]
pub struct Normal {
    blocks: Vec<Block>,
    gradient: DVector<f64>,
    hessian: DMatrix<f64>,
    /// Scratch of [`add_row`](Self::add_row): place and derivative of each parameter of a row.
    entries: Vec<(usize, f64)>,
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
    /// Adds equations over the same blocks.
    fn add_assign(&mut self, other: &Self) {
        self.gradient += &other.gradient;
        self.hessian += &other.hessian;
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
