//! What a contact simulator asks of a shape: signed distance with two derivatives.

use nalgebra::{Matrix3, Point3, Vector3};

/// Signed distance of a point and its derivatives, in the frame of the query point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldSample {
    /// Signed distance \[m\], negative inside.
    pub distance: f64,
    /// Gradient of the distance \[1\]; close to, but not exactly, unit length on an interpolated grid.
    pub gradient: Vector3<f64>,
    /// Hessian of the distance \[1/m\].
    pub hessian: Matrix3<f64>,
}

/// A signed distance field with continuous second derivatives almost everywhere.
pub trait DistanceField: Send + Sync {
    /// The field at `point`, or `None` where the distance exceeds `reach` \[m\].
    ///
    /// Culling happens here, before any arithmetic that carries derivatives.
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample>;

    /// The distance alone, the same number as [`Self::sample`]'s, for whoever needs no derivative; fields that can be quicker
    /// about it are.
    fn distance(&self, point: &Point3<f64>, reach: f64) -> Option<f64> {
        self.sample(point, reach).map(|s| s.distance)
    }

    /// How much the field rises over a length at most: 1 for a distance, a little more where it is interpolated. A field that
    /// is no distance (a height above terrain) must say so, or what is near to it is overlooked.
    fn lipschitz_bound(&self) -> f64 {
        1.25
    }
}
