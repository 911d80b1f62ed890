//! How the edges of a convex solid are round.

use prehend_autodiff::Scalar;

use crate::fields::INSET;

/// How the edges of a convex solid are round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Border {
    /// Within its size, by this radius \[m\]: for contact only, its mass is that of the sharp solid.
    Within(f64),
    /// By a border around the solid, whose width is its last dimension.
    Around,
}

/// What a round solid is made of, in the sharp one: how far that is moved outward, and the radius of the edges \[m\].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rounding<T> {
    outward: T,
    radius: T,
}

impl Border {
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
    /// How far the sharp solid is moved outward.
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

    /// How far the core of the field is inside of the sharp solid.
    pub(crate) fn core(&self) -> T {
        self.radius - self.outward
    }

    /// How far the centers of samples are.
    pub(crate) fn inset(&self) -> T {
        self.samples() - self.outward
    }
}
