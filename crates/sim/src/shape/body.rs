//! Bodies made of a shape.

use std::sync::Arc;

use prehend_autodiff::Scalar;

use super::Shape;
use super::error::ShapeError;
use crate::body::RigidBody;
use crate::world::body::{Body, Motion};

/// What a body is made of.
#[derive(Clone)]
pub(crate) struct Matter<S: Scalar> {
    pub(crate) shape: Shape<S>,
    /// \[kg/m³\], unless it is fixed.
    pub(crate) density: Option<S>,
}

impl<S: Scalar> Matter<S> {
    /// The same, each number through `f`.
    pub(crate) fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> Matter<T> {
        Matter { shape: self.shape.map(&f), density: self.density.map(f) }
    }
}

impl<S: Scalar> Shape<S> {
    /// Mass properties at a uniform `density` \[kg/m³\].
    fn rigid(&self, density: S) -> Result<RigidBody<S>, ShapeError> {
        if let Some(kind) = self.built.kind.fixed_only() {
            return Err(ShapeError::FixedOnly { kind });
        }
        let (mass, com, inertia) =
            self.moments().ok_or(ShapeError::FixedOnly { kind: "shape" })?.of_density(density);
        Ok(RigidBody::new(mass, inertia, com)?)
    }
}

impl Body {
    /// A body of uniform `density` \[kg/m³\] that forces move, with the mass properties, samples and field of `shape`. Its model frame is
    /// that of the shape.
    ///
    /// # Errors
    /// If the shape has no mass, as a half-space, or the density is not positive and finite.
    pub fn from_shape(name: &str, shape: &Shape, density: f64) -> Result<Self, ShapeError> {
        let body = Self::free(name, shape.rigid(density)?);
        Ok(body.made_of(Matter { shape: shape.clone(), density: Some(density) }))
    }

    /// A body that keeps the state it is given, with the samples and the field of `shape`.
    pub fn fixed_from_shape(name: &str, shape: &Shape) -> Self {
        Self::kinematic(name).made_of(Matter { shape: shape.clone(), density: None })
    }

    fn made_of(mut self, matter: Matter<f64>) -> Self {
        self.surface = matter.shape.surface().cloned();
        self.field = Some(Arc::clone(matter.shape.field()));
        self.matter = Some(matter);
        self
    }

    /// Sets the dimension called `name` of the shape that the body is made of \[m\], and with it mass, center of mass, inertia, samples
    /// and field. States stay those of the center of mass.
    ///
    /// # Errors
    /// If the body is not made of a shape, that has no such dimension, or there is no such shape.
    pub fn set_dimension(&mut self, name: &str, value: f64) -> Result<(), ShapeError> {
        let Some(Matter { shape, density }) = &self.matter else {
            return Err(ShapeError::NoShape { body: self.name.clone() });
        };
        let mut shape = shape.clone();
        shape.set_dimension(name, value)?;
        let density = *density;
        if let (Motion::Free(rigid), Some(density)) = (&mut self.motion, density) {
            *rigid = shape.rigid(density)?;
        }
        self.surface = shape.surface().cloned();
        self.field = Some(Arc::clone(shape.field()));
        self.matter = Some(Matter { shape, density });
        Ok(())
    }
}

impl<S: Scalar> Body<S> {
    /// The shape that it is made of, if any.
    pub fn shape(&self) -> Option<&Shape<S>> {
        self.matter.as_ref().map(|matter| &matter.shape)
    }
}
