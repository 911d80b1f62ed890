//! Interface of a kind of solid.

use nalgebra::Point3;
use prehend_autodiff::Scalar;
use prehend_geometry::Moments;

use super::round::Round;

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
}
