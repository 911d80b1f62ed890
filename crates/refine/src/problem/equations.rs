//! The normal equations that factors add to.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixView, DVector, DVectorView, SMatrix, Vector3};

use super::auxiliary::Auxiliary;
use super::triangular::{cholesky, solve_lower};
use super::{Block, ImageWarp};

/// Gradient Jᵀr and Gauss–Newton Hessian JᵀJ of ½‖r‖², a sum of factors, by the parameters of some blocks.
#[derive(Clone, Debug)]
pub struct NormalEquations {
    blocks: Vec<Block>,
    pub(super) gradient: DVector<f64>,
    pub(super) hessian: DMatrix<f64>,
    /// Number of surface patches, whose displacements no state holds: three auxiliary parameters each.
    patches: usize,
    /// By which the image may be off: its coefficients are auxiliary parameters, too, after the displacements.
    pub(super) image_warp: Option<Arc<ImageWarp>>,
    /// Derivatives by auxiliary parameters, once something depends on them.
    pub(super) by_auxiliary: Option<Auxiliary>,
    /// Derivatives of the row begun last by all parameters, and in which parts of them they are; place and derivative of each auxiliary one.
    pub(super) row: Vec<f64>,
    pub(super) parts: Vec<Range<usize>>,
    pub(super) auxiliary_entries: Vec<(usize, f64)>,
    /// How many independent measurements the residuals amount to.
    degrees: f64,
}

/// Gradient by the displacement of a patch, and Hessian by that and `N` parameters, the first three of which are the object's place: a patch that is
/// displaced does to what it shows what the object does when all of it is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PatchPart<const N: usize> {
    pub(crate) gradient: Vector3<f64>,
    pub(crate) hessian: SMatrix<f64, 3, N>,
}

impl<const N: usize> Default for PatchPart<N> {
    /// Zero.
    fn default() -> Self {
        Self { gradient: Vector3::zeros(), hessian: SMatrix::zeros() }
    }
}

/// Schur complement of the auxiliary parameters ([`NormalEquations::marginalize`]).
pub(crate) struct SchurComplement {
    /// The equations of the blocks.
    pub(crate) rest: NormalEquations,
    /// Decrease of the least value of ½‖r‖².
    pub(crate) gain: f64,
    /// Logarithm of the determinant of the auxiliary parameters' Hessian.
    pub(crate) log_determinant: f64,
}

impl NormalEquations {
    /// Empty equations over `blocks`, in that order.
    pub fn new(blocks: &[Block]) -> Self {
        Self::with_patches(blocks, 0)
    }

    /// Empty equations over `blocks`, and over the displacements of so many `patches` if a factor depends on them.
    pub(crate) fn with_patches(blocks: &[Block], patches: usize) -> Self {
        let n = blocks.iter().map(|b| b.dimension()).sum();
        Self {
            blocks: blocks.to_vec(),
            gradient: DVector::zeros(n),
            hessian: DMatrix::zeros(n, n),
            patches,
            image_warp: None,
            by_auxiliary: None,
            row: vec![0.0; n],
            parts: Vec::new(),
            auxiliary_entries: Vec::new(),
            degrees: 0.0,
        }
    }

    /// Equations over the coefficients of an image warp, too.
    pub(crate) fn with_image_warp(self, warp: Arc<ImageWarp>) -> Self {
        let auxiliary = Auxiliary::new(self.patches, warp.len(), self.dimension());
        Self { image_warp: Some(warp), by_auxiliary: Some(auxiliary), ..self }
    }

    /// The image warp, and the index of its first coefficient among the parameters of [`dense`](Self::dense).
    pub(crate) fn image_warp(&self) -> Option<(&Arc<ImageWarp>, usize)> {
        let first = self.dimension() + self.displacements();
        self.image_warp.as_ref().map(|warp| (warp, first))
    }

    /// Number of the blocks' parameters.
    pub(crate) fn dimension(&self) -> usize {
        self.gradient.len()
    }

    /// Number of parameters of all patches.
    pub(crate) fn displacements(&self) -> usize {
        3 * self.patches
    }

    /// Whether there are derivatives by auxiliary parameters.
    pub(crate) fn has_auxiliary(&self) -> bool {
        self.by_auxiliary.is_some()
    }

    /// Gradient and Hessian by the parameters of the blocks and then, if something depends on them, by the auxiliary ones: displacements and
    /// coefficients of the warp.
    pub(crate) fn dense(&self) -> (DVector<f64>, DMatrix<f64>) {
        let (n, m) = (self.dimension(), self.by_auxiliary.as_ref().map_or(0, Auxiliary::len));
        let (mut gradient, mut hessian) = (DVector::zeros(n + m), DMatrix::zeros(n + m, n + m));
        gradient.rows_mut(0, n).copy_from(&self.gradient);
        hessian.view_mut((0, 0), (n, n)).copy_from(&self.hessian);
        if let Some(auxiliary) = &self.by_auxiliary {
            gradient.rows_mut(n, m).copy_from(&auxiliary.gradient);
            hessian.view_mut((n, 0), (m, n)).copy_from(&auxiliary.coupling);
            hessian.view_mut((0, n), (n, m)).copy_from(&auxiliary.coupling.transpose());
            let mut own = DMatrix::zeros(m, m);
            auxiliary.add_own_to(&mut own);
            hessian.view_mut((n, n), (m, m)).copy_from(&own);
        }
        (gradient, hessian)
    }

    /// Begins a row without derivatives.
    pub(super) fn clear_row(&mut self) {
        self.parts.clear();
        self.auxiliary_entries.clear();
    }

    /// Writes derivatives of the row by the parameters from `offset` on; those that are there already are added to.
    #[inline]
    pub(super) fn write_row(&mut self, offset: usize, derivatives: &[f64]) {
        let end = offset + derivatives.len();
        let own = &mut self.row[offset..end];
        if self.parts.iter().any(|part| part.contains(&offset)) {
            own.iter_mut().zip(derivatives).for_each(|(sum, d)| *sum += d);
            return;
        }
        own.copy_from_slice(derivatives);
        // Blocks side by side are one part.
        match self.parts.last_mut().filter(|part| part.end == offset) {
            Some(part) => part.end = end,
            None => self.parts.push(offset..end),
        }
    }

    /// Copies what the Hessian has below the diagonal, which rows add to, above it.
    pub(super) fn mirror_lower(&mut self) {
        self.hessian.fill_upper_triangle_with_lower_triangle();
    }

    /// Where the parameters of `block` begin, or `None` if it was not requested.
    ///
    /// # Panics
    /// For joints of another number than was requested.
    pub fn offset(&self, block: Block) -> Option<usize> {
        offset(&self.blocks, block)
    }

    /// Eliminates the displacements of patches by the Schur complement. Their prior is a Gaussian of mean zero, independent by direction;
    /// `precision`, the inverse of its covariance in one direction, is added. `None` if the sum is singular.
    ///
    /// # Panics
    /// If the equations have coefficients of a warp, or another number of patches than `precision`.
    pub(crate) fn marginalize(&self, precision: &DMatrix<f64>) -> Option<SchurComplement> {
        assert!(self.image_warp.is_none(), "coefficients of a warp are not eliminated");
        assert_eq!(precision.nrows(), self.patches, "precision of the patches");
        let mut own = DMatrix::zeros(self.displacements(), self.displacements());
        for c in 0..precision.ncols() {
            for r in 0..precision.nrows() {
                for k in 0..3 {
                    own[(3 * r + k, 3 * c + k)] = precision[(r, c)];
                }
            }
        }
        if let Some(auxiliary) = &self.by_auxiliary {
            auxiliary.add_own_to(&mut own);
        }
        let lower = cholesky(own)?;
        let mut rest = Self {
            gradient: self.gradient.clone(),
            hessian: self.hessian.clone(),
            ..Self::new(&self.blocks)
        };
        let mut gain = 0.0;
        if let Some(Auxiliary { gradient, coupling, .. }) = &self.by_auxiliary {
            // Most of the blocks have nothing to do with any patch.
            let is_coupled = |c: &usize| coupling.column(*c).iter().any(|value| *value != 0.0);
            let coupled: Vec<usize> = (0..coupling.ncols()).filter(is_coupled).collect();
            let mut columns = coupling.select_columns(&coupled);
            let mut pull = gradient.clone();
            solve_lower(&lower, columns.as_mut_slice());
            solve_lower(&lower, pull.as_mut_slice());
            for (i, &c) in coupled.iter().enumerate() {
                rest.gradient[c] -= columns.column(i).dot(&pull);
                for (j, &r) in coupled.iter().enumerate() {
                    rest.hessian[(r, c)] -= columns.column(j).dot(&columns.column(i));
                }
            }
            gain = 0.5 * pull.norm_squared();
        }
        let log_determinant = 2.0 * lower.diagonal().iter().map(|d| d.ln()).sum::<f64>();
        Some(SchurComplement { rest, gain, log_determinant })
    }

    /// Drops the auxiliary parameters, as if they were zero.
    pub(crate) fn without_auxiliary(self) -> Self {
        Self { patches: 0, image_warp: None, by_auxiliary: None, ..self }
    }

    /// Derivative of the sum with respect to the requested parameters.
    pub fn gradient(&self) -> &DVector<f64> {
        &self.gradient
    }

    /// Gauss–Newton approximation of the second derivative: symmetric, positive semi-definite.
    pub fn hessian(&self) -> &DMatrix<f64> {
        &self.hessian
    }

    /// How many independent measurements the residuals amount to, those that are zero by a bound left out.
    pub fn degrees(&self) -> f64 {
        self.degrees
    }

    /// Counts so many independent measurements more.
    pub fn add_degrees(&mut self, degrees: f64) {
        self.degrees += degrees;
    }

    /// The requested blocks, in order.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Adds the gradient and Hessian of a factor whose parameters are those of `blocks`, concatenated.
    ///
    /// Parts that belong to blocks nobody requested are dropped. The Hessian must be symmetric: what is below its diagonal may replace what is above.
    ///
    /// # Panics
    /// If there are fewer numbers than the blocks have.
    pub fn add<'a>(
        &mut self,
        blocks: &[Block],
        gradient: impl Into<DVectorView<'a, f64>>,
        hessian: impl Into<DMatrixView<'a, f64>>,
    ) {
        let (gradient, hessian) = (gradient.into(), hessian.into());
        for row in places(&self.blocks, blocks) {
            let mut part = self.gradient.rows_mut(row.to, row.size);
            part += gradient.rows(row.from, row.size);
            for column in places(&self.blocks, blocks) {
                let size = (row.size, column.size);
                let mut part = self.hessian.view_mut((row.to, column.to), size);
                part += hessian.view((row.from, column.from), size);
            }
        }
    }

    /// Adds a gradient and Hessian by the parameters of `blocks`, followed by all displacements and, optionally, the coefficients of the warp.
    pub(crate) fn add_with_auxiliary(
        &mut self,
        blocks: &[Block],
        gradient: &DVector<f64>,
        hessian: &DMatrix<f64>,
    ) {
        self.add(blocks, gradient, hessian);
        let own = blocks.iter().map(|b| b.dimension()).sum();
        let count = gradient.len() - own;
        let (known, auxiliary) = self.blocks_and_auxiliary();
        let mut part = auxiliary.gradient.rows_mut(0, count);
        part += gradient.rows(own, count);
        for BlockPlace { from, to, size } in places(known, blocks) {
            let mut part = auxiliary.coupling.view_mut((0, to), (count, size));
            part += hessian.view((own, from), (count, size));
        }
        let mut part = auxiliary.others_mut().view_mut((0, 0), (count, count));
        part += hessian.view((own, own), (count, count));
    }

    /// Adds derivatives by the displacements of patches, by themselves and together with those by the parameters of `blocks`, of which the first
    /// three are the object's place.
    pub(crate) fn add_patches<const N: usize>(
        &mut self,
        blocks: &[Block],
        patches: &[PatchPart<N>],
    ) {
        if patches.is_empty() {
            return;
        }
        let (known, auxiliary) = self.blocks_and_auxiliary();
        for (patch, PatchPart { gradient, hessian }) in patches.iter().enumerate() {
            let own = hessian.fixed_columns::<3>(0).into_owned();
            auxiliary.add_patch(patch, gradient, &own);
            for BlockPlace { from, to, size } in places(known, blocks) {
                let mut part = auxiliary.coupling.view_mut((3 * patch, to), (3, size));
                part += hessian.columns(from, size);
            }
        }
    }

    /// The blocks, and derivatives by the auxiliary parameters to be added to.
    fn blocks_and_auxiliary(&mut self) -> (&[Block], &mut Auxiliary) {
        let (patches, n) = (self.patches, self.dimension());
        let auxiliary = self.by_auxiliary.get_or_insert_with(|| Auxiliary::new(patches, 0, n));
        (&self.blocks, auxiliary)
    }
}

impl std::ops::MulAssign<f64> for NormalEquations {
    /// Scales all derivatives, as those of a cost that is larger by `factor`.
    fn mul_assign(&mut self, factor: f64) {
        self.gradient *= factor;
        self.hessian *= factor;
        self.by_auxiliary.iter_mut().for_each(|auxiliary| *auxiliary *= factor);
    }
}

impl std::ops::AddAssign<&Self> for NormalEquations {
    /// Adds equations over the same blocks.
    fn add_assign(&mut self, other: &Self) {
        self.gradient += &other.gradient;
        self.hessian += &other.hessian;
        self.degrees += other.degrees;
        if let Some(auxiliary) = &other.by_auxiliary {
            *self.blocks_and_auxiliary().1 += auxiliary;
        }
    }
}

/// Where the parameters of `block` begin among those of `blocks`.
fn offset(blocks: &[Block], block: Block) -> Option<usize> {
    let Some(position) = blocks.iter().position(|&b| b == block) else {
        let joints = |b: &Block| matches!(b, Block::Joints(_));
        assert!(!joints(&block) || !blocks.iter().any(joints), "a hand has not {block:?}");
        return None;
    };
    Some(blocks[..position].iter().map(|b| b.dimension()).sum())
}

/// Where the parameters of a block are: among those of a factor, and among those that are requested.
struct BlockPlace {
    from: usize,
    to: usize,
    size: usize,
}

/// Those of a factor's `blocks` that are among the `known` ones.
fn places(known: &[Block], blocks: &[Block]) -> impl Iterator<Item = BlockPlace> {
    let mut next = 0;
    blocks.iter().filter_map(move |&block| {
        let (from, size) = (next, block.dimension());
        next += size;
        offset(known, block).map(|to| BlockPlace { from, to, size })
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::SVector;
    use prehend_geometry::SplitMix64;

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

    /// Three blocks, one of which shares no residual with the patches.
    #[test]
    fn what_is_eliminated_is_the_schur_complement() {
        let mut random = SplitMix64::new(7);
        let blocks = [Block::HandPose, Block::ObjectPose, Block::Camera];
        let mut equations = NormalEquations::with_patches(&blocks, 2);
        let mut patches = [PatchPart::<12>::default(); 2];
        for row in 0..40 {
            let row_of_all = SVector::<f64, 12>::from_fn(|_, _| random.normal());
            let (residual, place) = (random.normal(), row_of_all.fixed_rows::<3>(0).into_owned());
            let own = [Block::ObjectPose, Block::Camera];
            equations.add(&own, &(row_of_all * residual), &(row_of_all * row_of_all.transpose()));
            patches[row % 2].gradient += place * residual;
            patches[row % 2].hessian += place * row_of_all.transpose();
        }
        equations.add_patches(&[Block::ObjectPose, Block::Camera], &patches);
        let of_hand = SMatrix::<f64, 6, 6>::identity();
        equations.add(&[Block::HandPose], &SVector::<f64, 6>::repeat(1.0), &of_hand);
        let precision = DMatrix::from_row_slice(2, 2, &[2.0, -0.5, -0.5, 1.0]);
        let found = equations.marginalize(&precision).unwrap();
        let (gradient, mut hessian) = equations.dense();
        let mut own = hessian.view_mut((18, 18), (6, 6));
        own += precision.kronecker(&DMatrix::identity(3, 3));
        let own = hessian.view((18, 18), (6, 6)).into_owned();
        let (coupling, pull) = (hessian.view((18, 0), (6, 18)), gradient.rows(18, 6));
        let inverse = own.clone().try_inverse().unwrap();
        let of_rest = hessian.view((0, 0), (18, 18)) - coupling.tr_mul(&(&inverse * coupling));
        let by_rest = gradient.rows(0, 18) - coupling.tr_mul(&(&inverse * pull));
        assert!((found.rest.hessian() - of_rest).amax() < 1e-9);
        assert!((found.rest.gradient() - by_rest).amax() < 1e-9);
        assert!((found.gain - 0.5 * pull.dot(&(&inverse * pull))).abs() < 1e-9);
        assert!((found.log_determinant - own.determinant().ln()).abs() < 1e-9);
        assert!(!found.rest.has_auxiliary());
    }
}
