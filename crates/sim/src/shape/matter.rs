//! Shape and density of a body.

use prehend_autodiff::Scalar;

use super::Shape;

/// Shape and density of a body.
#[derive(Clone)]
pub(crate) struct DensityShape<S: Scalar> {
    pub(crate) shape: Shape<S>,
    /// \[kg/m³\], unless it is fixed.
    pub(crate) density: Option<S>,
}

impl<S: Scalar> DensityShape<S> {
    /// Shape and density with each number mapped by `f`.
    pub(crate) fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> DensityShape<T> {
        DensityShape { shape: self.shape.map(&f), density: self.density.map(f) }
    }
}
