//! Rounding of the edges of a convex solid.

use prehend_autodiff::Scalar;

use crate::fields::INSET;

/// Rounding of the edges of a convex solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Edges {
    /// Within its size, by this radius \[m\]: for contact only, its mass is that of the sharp solid.
    Within(f64),
    /// By a border around the solid, whose width is its last dimension.
    Around,
}

/// Distance by which the sharp solid is moved outward, and radius of the edges \[m\].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rounding<T> {
    outward: T,
    radius: T,
}

impl Edges {
    /// With the `dimensions` of the solid.
    pub(crate) fn rounding<T: Scalar>(self, dimensions: &[T]) -> Rounding<T> {
        match self {
            Self::Within(radius) => Rounding { outward: T::zero(), radius: T::constant(radius) },
            Self::Around => {
                let border = dimensions.last().copied().unwrap_or_default();
                Rounding { outward: border, radius: border }
            }
        }
    }

    /// The names of the dimensions `own` with that of the border.
    pub(crate) fn names(self, own: &[&str]) -> Vec<String> {
        let around = (self == Self::Around).then_some("border_radius");
        own.iter().copied().chain(around).map(str::to_owned).collect()
    }
}

impl<T: Scalar> Rounding<T> {
    /// Distance by which the sharp solid is moved outward.
    pub(crate) fn outward(&self) -> T {
        self.outward
    }

    /// Border of the field.
    pub(crate) fn border(&self) -> T {
        self.radius
    }

    /// Radius of the samples.
    pub(crate) fn samples(&self) -> T {
        self.radius.times(INSET)
    }

    /// Depth of the field's core inside of the sharp solid.
    pub(crate) fn core(&self) -> T {
        self.radius - self.outward
    }

    /// Depth of the centers of samples.
    pub(crate) fn inset(&self) -> T {
        self.samples() - self.outward
    }
}
