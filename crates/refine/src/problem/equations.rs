//! The normal equations that factors add to.

use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixView, DVector, DVectorView, SMatrix, SVector, Vector2};

use super::triangular::{cholesky, solve_lower};
use super::{Block, ImageWarp, Row};

/// Gradient Jᵀr and Gauss–Newton Hessian JᵀJ of ½‖r‖², a sum of factors, by the parameters of some blocks.
#[derive(Clone, Debug)]
pub struct NormalEquations {
    blocks: Vec<Block>,
    /// Number of the blocks' parameters.
    dimension: usize,
    /// Number of parameters that no state holds and that are eliminated: displacements of surface patches. They come last, and
    /// have room once something depends on them.
    auxiliary: usize,
    /// By which the image may be off: its coefficients come after the patches' displacements, and no state holds them either.
    image_warp: Option<Arc<ImageWarp>>,
    gradient: DVector<f64>,
    hessian: DMatrix<f64>,
    /// Place and derivative of each parameter of the row begun last.
    entries: Vec<(usize, f64)>,
}

/// What [`NormalEquations::marginalize`] finds.
pub(crate) struct SchurComplement {
    /// The equations of the blocks.
    pub(crate) rest: NormalEquations,
    /// How much lower the least value is.
    pub(crate) gain: f64,
    /// Logarithm of the determinant of the auxiliary parameters' Hessian.
    pub(crate) log_determinant: f64,
}

impl NormalEquations {
    /// Empty equations over `blocks`, in that order.
    pub fn new(blocks: &[Block]) -> Self {
        Self::with_auxiliary(blocks, 0)
    }

    /// Empty equations over `blocks`, and over `auxiliary` parameters if a factor depends on them.
    pub(crate) fn with_auxiliary(blocks: &[Block], auxiliary: usize) -> Self {
        let n = blocks.iter().map(|b| b.dimension()).sum();
        Self {
            blocks: blocks.to_vec(),
            dimension: n,
            auxiliary,
            image_warp: None,
            gradient: DVector::zeros(n),
            hessian: DMatrix::zeros(n, n),
            entries: Vec::new(),
        }
    }

    /// The same over the coefficients by which the image may be off, too.
    pub(crate) fn with_image_warp(mut self, warp: Arc<ImageWarp>) -> Self {
        self.image_warp = Some(warp);
        self.grow();
        self
    }

    /// By which the image may be off, and where its coefficients begin.
    pub(crate) fn image_warp(&self) -> Option<(&Arc<ImageWarp>, usize)> {
        self.image_warp.as_ref().map(|warp| (warp, self.dimension + self.auxiliary))
    }

    /// Number of the blocks' parameters.
    pub(crate) fn dimension(&self) -> usize {
        self.dimension
    }

    /// Number of auxiliary parameters that may be added to.
    pub(crate) fn auxiliary(&self) -> usize {
        self.auxiliary
    }

    /// Whether a factor has added derivatives by auxiliary parameters.
    pub(crate) fn has_auxiliary(&self) -> bool {
        self.gradient.len() > self.dimension
    }

    /// Makes room for the auxiliary parameters.
    fn grow(&mut self) {
        let warp = self.image_warp.as_ref().map_or(0, |warp| warp.len());
        let n = self.dimension + self.auxiliary + warp;
        if self.gradient.len() < n {
            let old = std::mem::replace(&mut self.gradient, DVector::zeros(n));
            self.gradient.rows_mut(0, old.len()).copy_from(&old);
            let old = std::mem::replace(&mut self.hessian, DMatrix::zeros(n, n));
            self.hessian.view_mut((0, 0), old.shape()).copy_from(&old);
        }
    }

    /// Where the parameters of `block` begin, or `None` if it was not requested.
    ///
    /// # Panics
    /// For joints of another number than was requested.
    pub fn offset(&self, block: Block) -> Option<usize> {
        let Some(position) = self.blocks.iter().position(|&b| b == block) else {
            let joints = |b: &Block| matches!(b, Block::Joints(_));
            assert!(!joints(&block) || !self.blocks.iter().any(joints), "a hand has not {block:?}");
            return None;
        };
        Some(self.blocks[..position].iter().map(|b| b.dimension()).sum())
    }

    /// Eliminates the auxiliary parameters, displacements in three directions each, by the Schur complement. Their prior is a
    /// Gaussian of mean zero, independent by direction; `precision`, the inverse of its covariance in one direction, is added.
    /// `None` if the sum is singular.
    pub(crate) fn marginalize(&self, precision: &DMatrix<f64>) -> Option<SchurComplement> {
        let (n, m) = (self.dimension, self.auxiliary);
        // As long as nothing depends on them there are none.
        let known = self.has_auxiliary();
        let part = |r: usize, c: usize, rows: usize, columns: usize| match known {
            true => self.hessian.view((r, c), (rows, columns)).clone_owned(),
            false => DMatrix::zeros(rows, columns),
        };
        let mut own = part(n, n, m, m);
        for c in 0..precision.ncols() {
            for r in 0..precision.nrows() {
                for k in 0..3 {
                    own[(3 * r + k, 3 * c + k)] += precision[(r, c)];
                }
            }
        }
        let lower = cholesky(own)?;
        let mut coupling = part(n, 0, m, n);
        let mut pull = match known {
            true => self.gradient.rows(n, m).clone_owned(),
            false => DVector::zeros(m),
        };
        solve_lower(&lower, coupling.as_mut_slice());
        solve_lower(&lower, pull.as_mut_slice());
        let rest = Self {
            blocks: self.blocks.clone(),
            dimension: n,
            auxiliary: 0,
            image_warp: None,
            gradient: self.gradient.rows(0, n) - coupling.tr_mul(&pull),
            hessian: self.hessian.view((0, 0), (n, n)) - coupling.tr_mul(&coupling),
            entries: Vec::new(),
        };
        let log_determinant = 2.0 * lower.diagonal().iter().map(|d| d.ln()).sum::<f64>();
        Some(SchurComplement { rest, gain: 0.5 * pull.norm_squared(), log_determinant })
    }

    /// Drops the auxiliary parameters, as if they were zero.
    pub(crate) fn without_auxiliary(self) -> Self {
        let n = self.dimension;
        Self {
            auxiliary: 0,
            image_warp: None,
            gradient: self.gradient.rows(0, n).clone_owned(),
            hessian: self.hessian.view((0, 0), (n, n)).clone_owned(),
            ..self
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

    /// Begins a row, the derivatives of a residual.
    #[inline]
    pub(super) fn begin_row(&mut self) -> Row<'_> {
        self.entries.clear();
        Row { equations: self }
    }

    /// Derivatives of the row begun last by the parameters of `block`; dropped if nobody requested it.
    #[inline]
    pub(super) fn push_entries(&mut self, block: Block, derivatives: &[f64]) {
        assert_eq!(derivatives.len(), block.dimension(), "derivatives by {block:?}");
        if let Some(offset) = self.offset(block) {
            self.entries.extend(derivatives.iter().enumerate().map(|(i, &d)| (offset + i, d)));
        }
    }

    /// The same by one parameter of `block`.
    #[inline]
    pub(super) fn push_entry(&mut self, block: Block, index: usize, derivative: f64) {
        if let Some(offset) = self.offset(block) {
            self.entries.push((offset + index, derivative));
        }
    }

    /// The derivatives by what the image is off by at `pixel`, seen along `ray`; dropped if nobody asks for them.
    #[inline]
    pub(super) fn push_warp(
        &mut self,
        pixel: &Vector2<f64>,
        ray: &Vector2<f64>,
        by_camera: &[f64],
    ) {
        let Some(warp) = &self.image_warp else { return };
        let first = self.dimension + self.auxiliary;
        let derivatives = warp.derivatives(pixel, ray, by_camera);
        self.entries.extend(derivatives.map(|(k, derivative)| (first + k, derivative)));
    }

    /// Adds ½ `weight` r² of the residual r whose derivatives are the row begun last.
    #[inline]
    pub(super) fn finish_row(&mut self, residual: f64, weight: f64) {
        for &(i, d) in &self.entries {
            self.gradient[i] += weight * residual * d;
            let column = &mut self.hessian.column_mut(i);
            for &(j, e) in &self.entries {
                column[j] += weight * d * e;
            }
        }
    }

    /// Adds the gradient and Hessian of a factor whose parameters are those of `blocks`, concatenated.
    ///
    /// Parts that belong to blocks nobody requested are dropped.
    pub fn add<const N: usize>(
        &mut self,
        blocks: &[Block],
        gradient: &SVector<f64, N>,
        hessian: &SMatrix<f64, N, N>,
    ) {
        self.add_views(blocks, 0, &gradient.as_view(), &hessian.as_view());
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
        self.add_views(blocks, 0, &gradient.as_view(), &hessian.as_view());
    }

    /// The same with derivatives by all auxiliary parameters, after those by the blocks.
    pub(crate) fn add_with_auxiliary(
        &mut self,
        blocks: &[Block],
        gradient: &DVector<f64>,
        hessian: &DMatrix<f64>,
    ) {
        self.grow();
        // Those of an image's warp too, where they are given.
        let auxiliary = gradient.len() - blocks.iter().map(|b| b.dimension()).sum::<usize>();
        self.add_views(blocks, auxiliary, &gradient.as_view(), &hessian.as_view());
    }

    /// Adds what the patches of a surface show, of each the gradient and Hessian by the parameters of `blocks`, the first three of which are the
    /// object's place: a patch that is displaced does to what it shows what the object does when all of it is. `all` is their sum.
    pub(crate) fn add_by_patch<const N: usize>(
        &mut self,
        blocks: &[Block],
        all: &(SVector<f64, N>, SMatrix<f64, N, N>),
        patches: &[(SVector<f64, N>, SMatrix<f64, N, N>)],
    ) {
        self.add(blocks, &all.0, &all.1);
        if patches.is_empty() {
            return;
        }
        self.grow();
        let mut local = 0;
        for block in blocks {
            let size = block.dimension();
            if let Some(to) = self.offset(*block) {
                for (patch, (_, hessian)) in patches.iter().enumerate() {
                    let at = self.dimension + 3 * patch;
                    for column in 0..3 {
                        for row in 0..size {
                            let value = hessian[(local + row, column)];
                            self.hessian[(to + row, at + column)] += value;
                            self.hessian[(at + column, to + row)] += value;
                        }
                    }
                }
            }
            local += size;
        }
        for (patch, (gradient, hessian)) in patches.iter().enumerate() {
            let at = self.dimension + 3 * patch;
            let mut own = self.gradient.fixed_rows_mut::<3>(at);
            own += gradient.fixed_rows::<3>(0);
            let mut own = self.hessian.fixed_view_mut::<3, 3>(at, at);
            own += hessian.fixed_view::<3, 3>(0, 0);
        }
    }

    fn add_views(
        &mut self,
        blocks: &[Block],
        auxiliary: usize,
        gradient: &DVectorView<f64>,
        hessian: &DMatrixView<f64>,
    ) {
        let mut local = 0;
        let mut places: Vec<(usize, usize, usize)> = blocks
            .iter()
            .filter_map(|&b| {
                let from = local;
                local += b.dimension();
                self.offset(b).map(|to| (from, to, b.dimension()))
            })
            .collect();
        if auxiliary > 0 {
            places.push((local, self.dimension, auxiliary));
        }
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

impl std::ops::AddAssign<&Self> for NormalEquations {
    /// Adds equations over the same blocks.
    fn add_assign(&mut self, other: &Self) {
        if other.has_auxiliary() {
            self.grow();
        }
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
        let mut normal = NormalEquations::new(&[Block::HandPose, Block::ObjectPose]);
        let gradient = SVector::<f64, 12>::from_fn(|r, _| r as f64);
        let hessian = SMatrix::<f64, 12, 12>::from_fn(|r, c| (r * 100 + c) as f64);
        normal.add(&[Block::ObjectPose, Block::HandPose], &gradient, &hessian);
        assert_eq!((normal.gradient()[0], normal.gradient()[6]), (6.0, 0.0));
        assert_eq!(normal.hessian()[(0, 7)], 601.0);

        let mut pose_only = NormalEquations::new(&[Block::ObjectPose]);
        pose_only.add(&[Block::HandPose, Block::ObjectPose], &gradient, &hessian);
        assert_eq!((pose_only.gradient()[0], pose_only.hessian()[(0, 1)]), (6.0, 607.0));
    }
}
