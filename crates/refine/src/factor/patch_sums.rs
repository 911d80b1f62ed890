//! Normal equations by patch.

use nalgebra::{DMatrix, DVector, SMatrix, SVector, Vector2};

use crate::problem::{Block, NormalEquations, PatchPart, radial_as_camera};

/// Gradient and Gauss–Newton Hessian by `N` parameters, the first three of which are the object's place, and by the displacements of patches,
/// whose derivatives are among those by the object's place ([`PatchPart`]).
pub(super) struct PatchSums<const N: usize> {
    gradient: SVector<f64, N>,
    hessian: SMatrix<f64, N, N>,
    patches: Vec<PatchPart<N>>,
}

impl<const N: usize> PatchSums<N> {
    /// Zero sums of `count` patches.
    pub(super) fn new(count: usize) -> Self {
        Self {
            gradient: SVector::zeros(),
            hessian: SMatrix::zeros(),
            patches: vec![PatchPart::default(); count],
        }
    }

    /// Adds the gradient and Hessian by the parameters of what is seen in `patch`, or in none.
    pub(super) fn add(
        &mut self,
        patch: Option<usize>,
        gradient: &SVector<f64, N>,
        hessian: &SMatrix<f64, N, N>,
    ) {
        self.gradient += gradient;
        self.hessian += hessian;
        if let Some(part) = patch.map(|patch| &mut self.patches[patch]) {
            part.gradient += gradient.fixed_rows::<3>(0);
            part.hessian += hessian.fixed_rows::<3>(0);
        }
    }

    /// Adds the gradient and Hessian of ½ `weight` r² of a `residual` r whose derivatives by the parameters are `row`, as [`add`](Self::add) does.
    pub(super) fn add_row(
        &mut self,
        patch: Option<usize>,
        row: &SVector<f64, N>,
        residual: f64,
        weight: f64,
    ) {
        self.gradient.axpy(weight * residual, row, 1.0);
        self.hessian.ger(weight, row, row, 1.0);
        if let Some(part) = patch.map(|patch| &mut self.patches[patch]) {
            let place = row.fixed_rows::<3>(0);
            part.gradient.axpy(weight * residual, &place, 1.0);
            part.hessian.ger(weight, &place, row, 1.0);
        }
    }

    /// Where the displacement of `patch` is among all parameters.
    pub(super) fn place(patch: usize) -> usize {
        N + 3 * patch
    }

    /// Adds all to `equations`: by object pose and camera, by the displacements of all patches, if there are any, and by what the image is off by,
    /// if somebody asks for that; `center` is the ray (x/z, y/z) to the object.
    pub(super) fn add_to(&self, center: &Vector2<f64>, equations: &mut NormalEquations) {
        if let Some((warp, _)) = equations.image_warp() {
            let (mut gradient, mut hessian) = self.equations();
            // Around the object's center, distortion is as a change of the camera; of depth images say nothing.
            let (known, camera) = (gradient.len(), N - Block::Camera.dimension());
            let (first, radial) = (N + equations.displacements(), radial_as_camera(center));
            let mut by_all = DMatrix::zeros(known, first + warp.len());
            by_all.fill_with_identity();
            by_all.view_mut((camera, first), radial.shape()).copy_from(&radial);
            gradient = by_all.tr_mul(&gradient);
            hessian = by_all.tr_mul(&(hessian * &by_all));
            add_to(equations, &gradient, &hessian);
        } else {
            self.add_plainly_to(equations);
        }
    }

    /// Adds all to `equations` but what the image is off by.
    pub(super) fn add_plainly_to(&self, equations: &mut NormalEquations) {
        let blocks = [Block::ObjectPose, Block::Camera];
        equations.add(&blocks, &self.gradient, &self.hessian);
        equations.add_patches(&blocks, &self.patches);
    }

    /// Gradient and Hessian by the parameters and by the displacements of all patches.
    pub(super) fn equations(&self) -> (DVector<f64>, DMatrix<f64>) {
        let size = Self::place(self.patches.len());
        let (mut gradient, mut hessian) = (DVector::zeros(size), DMatrix::zeros(size, size));
        gradient.fixed_rows_mut::<N>(0).copy_from(&self.gradient);
        hessian.fixed_view_mut::<N, N>(0, 0).copy_from(&self.hessian);
        for (patch, part) in self.patches.iter().enumerate() {
            let at = Self::place(patch);
            let own = part.hessian.fixed_columns::<3>(0);
            gradient.fixed_rows_mut::<3>(at).copy_from(&part.gradient);
            hessian.fixed_view_mut::<3, 3>(at, at).copy_from(&own);
            hessian.fixed_view_mut::<3, N>(at, 0).copy_from(&part.hessian);
            hessian.fixed_view_mut::<N, 3>(0, at).copy_from(&part.hessian.transpose());
        }
        (gradient, hessian)
    }
}

/// Adds derivatives by object pose, camera and, if there are more of them, the displacements of patches.
pub(super) fn add_to(
    equations: &mut NormalEquations,
    gradient: &DVector<f64>,
    hessian: &DMatrix<f64>,
) {
    let blocks = [Block::ObjectPose, Block::Camera];
    let rigid: usize = blocks.iter().map(|block| block.dimension()).sum();
    if gradient.len() > rigid {
        equations.add_with_auxiliary(&blocks, gradient, hessian);
    } else {
        equations.add(&blocks, gradient, hessian);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::problem::{DepthField, ImageWarp, RADIAL};

    #[test]
    fn a_patch_moves_what_it_shows_as_the_object_does() {
        // Residuals with derivatives by the object's place and one thing more.
        let rows = [
            (Some(0), [1.0, -2.0, 0.5, 3.0]),
            (Some(1), [0.5, 1.0, 2.0, -1.0]),
            (Some(1), [-1.5, 0.25, 1.0, 2.0]),
            (None, [2.0, 1.0, -1.0, 0.5]),
        ];
        let mut sums = PatchSums::<4>::new(2);
        let mut expected = DMatrix::zeros(10, 10);
        let mut pull = DVector::zeros(10);
        for (residual, (patch, row)) in rows.iter().enumerate() {
            let residual = residual as f64 - 1.5;
            let derivatives = SVector::from(*row);
            sums.add_row(*patch, &derivatives, residual, 1.0);
            let mut whole = DVector::zeros(10);
            whole.rows_mut(0, 4).copy_from(&derivatives);
            if let Some(patch) = patch {
                whole.rows_mut(4 + 3 * patch, 3).copy_from(&derivatives.fixed_rows::<3>(0));
            }
            pull.axpy(residual, &whole, 1.0);
            expected += &whole * whole.transpose();
        }
        let (gradient, hessian) = sums.equations();
        assert!((gradient - pull).amax() < 1e-12);
        assert!((hessian - expected).amax() < 1e-12);
    }

    /// Derivatives by distortion come after all patches of the equations, whether or not the factor knows of them.
    #[test]
    fn distortion_comes_after_the_patches() {
        let row = SVector::<f64, 12>::from_fn(|k, _| (k as f64 + 1.0).sin());
        let center = Vector2::new(0.2, -0.1);
        let warp = Arc::new(ImageWarp { depth: DepthField::new(640, 480, 4) });
        for patches in [0, 2] {
            let mut sums = PatchSums::<12>::new(patches);
            sums.add((patches > 0).then_some(1), &row, &(row * row.transpose()));
            let blocks = [Block::ObjectPose, Block::Camera];
            let mut equations =
                NormalEquations::with_patches(&blocks, 2).with_image_warp(Arc::clone(&warp));
            sums.add_to(&center, &mut equations);
            let mut expected = DVector::zeros(12 + 6 + warp.len());
            expected.rows_mut(0, 12).copy_from(&row);
            if patches > 0 {
                expected.rows_mut(15, 3).copy_from(&row.fixed_rows::<3>(0));
            }
            let radial = radial_as_camera(&center).tr_mul(&row.fixed_rows::<6>(6));
            expected.rows_mut(18, RADIAL).copy_from(&radial);
            let (gradient, hessian) = equations.dense();
            assert!((gradient - &expected).amax() < 1e-12, "{patches}");
            let of_all = &expected * expected.transpose();
            assert!((hessian - of_all).amax() < 1e-12, "{patches}");
        }
    }
}
