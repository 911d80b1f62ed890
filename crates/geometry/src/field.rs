//! Signed distance fields with gradient and Hessian, for contact simulation.

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

    /// The distance alone, bit for bit that of [`Self::sample`]. Override it where that is faster.
    fn distance(&self, point: &Point3<f64>, reach: f64) -> Option<f64> {
        self.sample(point, reach).map(|s| s.distance)
    }

    /// An upper bound of the field's Lipschitz constant \[1\]: 1 for an exact distance, a little more for an interpolated one. A
    /// field that is not a distance, such as the height above terrain, must return its own, or contacts are missed.
    fn lipschitz_bound(&self) -> f64 {
        1.25
    }

    /// How thick the solid is about where it is thinnest \[m\], infinite where nothing can pass through it: steps of a
    /// simulation are short enough not to pass over it.
    fn thickness(&self) -> f64 {
        f64::INFINITY
    }

    /// Center and radius \[m\] of a ball that holds the solid, none if it has no end or none is known: contacts are looked for
    /// within it.
    fn bounding_ball(&self) -> Option<(Point3<f64>, f64)> {
        None
    }
}
