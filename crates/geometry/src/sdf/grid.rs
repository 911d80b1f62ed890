//! A dense grid of a signed distance, interpolated with continuous second derivatives.

use nalgebra::{Matrix3, Point3, Vector3};

use super::Lattice;
use super::spline::{Basis, prefilter};
use crate::closest::box_distance;
use crate::field::{DistanceField, FieldSample};

/// A signed distance on a uniform grid, interpolated by a tricubic B-spline (twice continuously
/// differentiable everywhere, through every sample).
///
/// The spline is smooth, the distance is not: within about two spacings of a kink (a sharp edge, the
/// medial axis) the two differ by a fraction of the spacing.
///
/// The grid covers the shape's box plus a margin. Any point outside the grid is at least the margin
/// away from the shape, so a margin of the caller's reach or more makes every answer an interpolation.
/// With a reach beyond the margin, points outside the grid get the spline continued by straight lines:
/// still twice continuously differentiable, right to first order at the border, and rough far from it.
#[derive(Clone, Debug)]
pub struct SdfGrid {
    pub(super) lattice: Lattice,
    pub(super) coefficients: Vec<f64>,
    /// Box around the shape itself \[m\].
    pub(super) bounds: (Point3<f64>, Point3<f64>),
    /// Largest depth of a coefficient, which no point exceeds \[m\].
    deepest: f64,
}

impl SdfGrid {
    /// `samples` holds a value for each sample of the lattice, the last index fastest.
    pub(super) fn from_samples(
        lattice: Lattice,
        samples: &[f64],
        bounds: (Point3<f64>, Point3<f64>),
    ) -> Self {
        Self::from_coefficients(lattice, prefilter(samples, lattice.dims()), bounds)
    }

    pub(super) fn from_coefficients(
        lattice: Lattice,
        coefficients: Vec<f64>,
        bounds: (Point3<f64>, Point3<f64>),
    ) -> Self {
        let deepest = coefficients.iter().fold(0.0, |deepest: f64, c| deepest.max(-c));
        Self { lattice, coefficients, bounds, deepest }
    }

    /// Distance between samples \[m\].
    pub fn spacing(&self) -> f64 {
        self.lattice.spacing()
    }

    /// Number of samples along each axis.
    pub fn dims(&self) -> [usize; 3] {
        self.lattice.dims()
    }

    /// Smallest and largest corner of the box around the shape, without the margin \[m\].
    pub fn bounds(&self) -> (Point3<f64>, Point3<f64>) {
        self.bounds
    }

    /// Distance from `point` to the box around the shape: never above the exact distance outside \[m\].
    #[inline]
    pub fn lower_bound(&self, point: &Point3<f64>) -> f64 {
        box_distance(&self.bounds, point)
    }

    /// True unless the spline is above `reach` at `point`: outside of the box, too, it may be less than the distance by a fraction of the spacing. Written
    /// so that NaN is far away.
    #[inline]
    fn may_be_within(&self, point: &Point3<f64>, reach: f64) -> bool {
        self.lower_bound(point) <= reach + self.spacing()
    }

    /// Value, gradient and Hessian of the spline at `point`, wherever it is.
    #[inline]
    pub fn evaluate(&self, point: &Point3<f64>) -> FieldSample {
        let inverse = 1.0 / self.lattice.spacing();
        let dims = self.lattice.dims();
        let x = (point - self.lattice.origin()) * inverse;
        let [bx, by, bz] = [0, 1, 2].map(|i| Basis::at(x[i], dims[i]));
        let (sy, sz) = (dims[1] + 2, dims[2] + 2);
        // Sums over x, then y, each for four consecutive z: value, x and xx; then with y derivatives.
        let mut planes = [[0.0; 4]; 6];
        for j in 0..4 {
            let mut lines = [[0.0; 4]; 3];
            for i in 0..4 {
                let start = ((bx.first + i) * sy + by.first + j) * sz + bz.first;
                let c = &self.coefficients[start..start + 4];
                for (line, weights) in lines.iter_mut().zip(&bx.weights) {
                    for k in 0..4 {
                        line[k] += weights[i] * c[k];
                    }
                }
            }
            let [w, d, dd] = by.weights.map(|weights| weights[j]);
            for k in 0..4 {
                planes[0][k] += w * lines[0][k];
                planes[1][k] += w * lines[1][k];
                planes[2][k] += w * lines[2][k];
                planes[3][k] += d * lines[0][k];
                planes[4][k] += d * lines[1][k];
                planes[5][k] += dd * lines[0][k];
            }
        }
        let along_z = |plane: usize, derivative: usize| -> f64 {
            let weights = &bz.weights[derivative];
            (0..4).map(|k| planes[plane][k] * weights[k]).sum()
        };
        let (xx, yy, zz) = (along_z(2, 0), along_z(5, 0), along_z(0, 2));
        let (xy, xz, yz) = (along_z(4, 0), along_z(1, 1), along_z(3, 1));
        FieldSample {
            distance: along_z(0, 0),
            gradient: Vector3::new(along_z(1, 0), along_z(3, 0), along_z(0, 1)) * inverse,
            hessian: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) * (inverse * inverse),
        }
    }
}

impl SdfGrid {
    /// The value of the spline at `point`: that of [`Self::evaluate`] to the last bit.
    #[inline]
    pub fn value(&self, point: &Point3<f64>) -> f64 {
        let dims = self.lattice.dims();
        let x = (point - self.lattice.origin()) * (1.0 / self.lattice.spacing());
        let [bx, by, bz] = [0, 1, 2].map(|i| Basis::at(x[i], dims[i]));
        let (sy, sz) = (dims[1] + 2, dims[2] + 2);
        let mut plane = [0.0; 4];
        for j in 0..4 {
            let mut line = [0.0; 4];
            for i in 0..4 {
                let start = ((bx.first + i) * sy + by.first + j) * sz + bz.first;
                let c = &self.coefficients[start..start + 4];
                for k in 0..4 {
                    line[k] += bx.weights[0][i] * c[k];
                }
            }
            for k in 0..4 {
                plane[k] += by.weights[0][j] * line[k];
            }
        }
        (0..4).map(|k| plane[k] * bz.weights[0][k]).sum()
    }
}

impl DistanceField for SdfGrid {
    #[inline]
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        if self.may_be_within(point, reach) {
            let sample = self.evaluate(point);
            return (sample.distance <= reach).then_some(sample);
        }
        None
    }

    #[inline]
    fn distance(&self, point: &Point3<f64>, reach: f64) -> Option<f64> {
        if self.may_be_within(point, reach) {
            let distance = self.value(point);
            return (distance <= reach).then_some(distance);
        }
        None
    }

    /// Twice the largest depth: right for walls, too much for a shape with parts of many thicknesses.
    fn thickness(&self) -> f64 {
        if self.deepest > 0.0 { 2.0 * self.deepest } else { f64::INFINITY }
    }

    fn bounding_ball(&self) -> Option<(Point3<f64>, f64)> {
        let (low, high) = &self.bounds;
        Some((nalgebra::center(low, high), 0.5 * (high - low).norm() + self.spacing()))
    }
}

#[cfg(test)]
mod tests;
