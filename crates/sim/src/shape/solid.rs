//! Interface of a kind of solid.

use nalgebra::Point3;
use prehend_autodiff::Scalar;
use prehend_geometry::Moments;

use super::border::Edges;
use super::round::Round;
use crate::magnitude::SMALLEST;

/// A ball that touches others where they are nearest: its center and radius \[m\] and the area that it stands for \[m²\].
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoundSample<T: Scalar> {
    pub(crate) center: Point3<T>,
    pub(crate) radius: T,
    pub(crate) area: T,
}

/// A convex solid of a few dimensions, which may carry derivatives. How many samples it has follows from their values.
pub(crate) trait Convex {
    /// Names of its dimensions.
    fn names(&self) -> Vec<String>;

    /// Volume, center and second moments.
    fn moments<T: Scalar>(&self, dimensions: &[T]) -> Moments<T>;

    /// Signed distance to it.
    fn round<T: Scalar>(&self, dimensions: &[T]) -> Round<T>;

    /// Samples of its surface.
    fn samples<T: Scalar>(&self, dimensions: &[T]) -> Vec<RoundSample<T>>;

    /// Smallest value of the dimension called `name`.
    fn least(&self, _name: &str) -> f64 {
        SMALLEST
    }

    /// Half the extents of the box that holds a lattice of samples, and the distance of these \[m\].
    fn lattice(&self, _dimensions: &[f64]) -> Option<([f64; 3], f64)> {
        None
    }

    /// Rounding of its edges, if it has edges.
    fn border(&self) -> Option<Edges> {
        None
    }

    /// Least inset of its faces that leaves nothing \[m\], if it is convex.
    fn deepest(&self, _dimensions: &[f64]) -> Option<f64> {
        Some(f64::INFINITY)
    }
}
