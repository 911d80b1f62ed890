//! Derivatives by parameters that no state holds.

use std::ops::{AddAssign, MulAssign};

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Gradient and Hessian by auxiliary parameters: the displacements of patches, three of each, and after them the coefficients of an image's warp.
#[derive(Clone, Debug)]
pub(super) struct Auxiliary {
    pub(super) gradient: DVector<f64>,
    /// Hessian by them (rows) and by the parameters of the blocks (columns).
    pub(super) coupling: DMatrix<f64>,
    /// Hessian by them alone: parts of patches by their own displacements, and what else there is, if anything.
    by_patch: Vec<Matrix3<f64>>,
    others: Option<DMatrix<f64>>,
}

impl Auxiliary {
    /// Zeros for the displacements of `patches` patches and `warp` coefficients, beside `dimension` parameters of blocks.
    pub(super) fn new(patches: usize, warp: usize, dimension: usize) -> Self {
        let count = 3 * patches + warp;
        Self {
            gradient: DVector::zeros(count),
            coupling: DMatrix::zeros(count, dimension),
            by_patch: vec![Matrix3::zeros(); patches],
            others: None,
        }
    }

    /// Number of parameters.
    pub(super) fn len(&self) -> usize {
        self.gradient.len()
    }

    /// Adds what one patch has by its own displacement.
    pub(super) fn add_patch(
        &mut self,
        patch: usize,
        gradient: &Vector3<f64>,
        hessian: &Matrix3<f64>,
    ) {
        let mut part = self.gradient.fixed_rows_mut::<3>(3 * patch);
        part += gradient;
        self.by_patch[patch] += hessian;
    }

    /// Adds ½ `weight` r² of a `residual` r whose derivatives by some of these are `own`, and by some of the blocks' parameters `by_blocks`.
    pub(super) fn add_row(
        &mut self,
        own: &[(usize, f64)],
        by_blocks: impl Iterator<Item = (usize, f64)> + Clone,
        residual: f64,
        weight: f64,
    ) {
        for &(k, d) in own {
            self.gradient[k] += weight * residual * d;
            for (j, e) in by_blocks.clone() {
                self.coupling[(k, j)] += weight * d * e;
            }
        }
        let hessian = self.others_mut();
        for &(k, d) in own {
            for &(l, e) in own {
                hessian[(l, k)] += weight * d * e;
            }
        }
    }

    /// Hessian by the auxiliary parameters alone, without the patches' own blocks.
    pub(super) fn others_mut(&mut self) -> &mut DMatrix<f64> {
        let count = self.len();
        self.others.get_or_insert_with(|| DMatrix::zeros(count, count))
    }

    /// Adds the Hessian by these alone to `sum`.
    pub(super) fn add_own_to(&self, sum: &mut DMatrix<f64>) {
        for (patch, part) in self.by_patch.iter().enumerate() {
            let mut at = sum.fixed_view_mut::<3, 3>(3 * patch, 3 * patch);
            at += part;
        }
        if let Some(others) = &self.others {
            *sum += others;
        }
    }
}

impl MulAssign<f64> for Auxiliary {
    /// Scales all derivatives.
    fn mul_assign(&mut self, factor: f64) {
        self.gradient *= factor;
        self.coupling *= factor;
        self.by_patch.iter_mut().for_each(|part| *part *= factor);
        self.others.iter_mut().for_each(|others| *others *= factor);
    }
}

impl AddAssign<&Self> for Auxiliary {
    /// Adds derivatives by the same parameters.
    fn add_assign(&mut self, other: &Self) {
        self.gradient += &other.gradient;
        self.coupling += &other.coupling;
        self.by_patch.iter_mut().zip(&other.by_patch).for_each(|(part, other)| *part += other);
        if let Some(others) = &other.others {
            *self.others_mut() += others;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_and_rows_add_up() {
        let mut sum = Auxiliary::new(2, 0, 1);
        sum.add_patch(1, &Vector3::new(1.0, 2.0, 3.0), &Matrix3::identity());
        let mut rows = Auxiliary::new(2, 0, 1);
        rows.add_row(&[(5, 2.0), (0, -1.0)], [(0, 3.0)].into_iter(), 0.5, 2.0);
        sum += &rows;
        assert_eq!(sum.gradient.as_slice(), [-1.0, 0.0, 0.0, 1.0, 2.0, 5.0]);
        assert_eq!(sum.coupling.as_slice(), [-6.0, 0.0, 0.0, 0.0, 0.0, 12.0]);
        let mut own = DMatrix::zeros(6, 6);
        sum.add_own_to(&mut own);
        let mut expected = DMatrix::zeros(6, 6);
        expected.fixed_view_mut::<3, 3>(3, 3).fill_with_identity();
        expected[(5, 5)] += 8.0;
        expected[(0, 0)] = 2.0;
        (expected[(0, 5)], expected[(5, 0)]) = (-4.0, -4.0);
        assert_eq!(own, expected);
    }
}
