//! Bodies made of a shape.

use std::sync::Arc;

use prehend_autodiff::Scalar;

use super::body::{Body, Motion};
use crate::shape::Shape;
use crate::shape::error::ShapeError;

/// Shape and density of a body.
#[derive(Clone)]
pub(crate) struct DensityShape<S: Scalar> {
    pub(crate) shape: Shape<S>,
    /// \[kg/m³\], unless it is fixed.
    pub(crate) density: Option<S>,
}

impl<S: Scalar> DensityShape<S> {
    /// Shape and density with each number mapped by `f`.
    pub(super) fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> DensityShape<T> {
        DensityShape { shape: self.shape.map(&f), density: self.density.map(f) }
    }
}

impl<S: Scalar> Body<S> {
    /// A body of uniform `density` \[kg/m³\] that forces move, with the mass properties, samples and field of `shape`. Its body frame is
    /// that of the shape.
    ///
    /// # Errors
    /// If the shape has no mass, as a half-space, or the density is not positive and finite.
    pub fn from_shape(name: &str, shape: &Shape<S>, density: S) -> Result<Self, ShapeError> {
        let body = Self::dynamic(name, shape.rigid(density)?);
        Ok(body.made_of(DensityShape { shape: shape.clone(), density: Some(density) }))
    }

    /// A body that keeps the state it is given, with the samples and the field of `shape`.
    pub fn fixed_from_shape(name: &str, shape: &Shape<S>) -> Self {
        Self::fixed(name).made_of(DensityShape { shape: shape.clone(), density: None })
    }

    fn made_of(mut self, DensityShape { shape, density }: DensityShape<S>) -> Self {
        self.reshape(shape, density);
        self
    }

    /// Sets the dimension called `name` of the shape that the body is made of \[m\], and with it mass, center of mass, inertia, samples
    /// and field: to differentiate by it, put in a variable. States stay those of the center of mass; where the pose of the body frame
    /// is given instead, they follow from [`RigidBody::at_rest`](crate::RigidBody::at_rest).
    ///
    /// # Errors
    /// If the body is not made of a shape, that has no such dimension, or there is no such shape.
    pub fn set_dimension(&mut self, name: &str, value: S) -> Result<(), ShapeError> {
        let Some(DensityShape { shape, density }) = &self.matter else {
            return Err(ShapeError::NoShape { body: self.name.clone() });
        };
        let mut shape = shape.clone();
        shape.set_dimension(name, value)?;
        let density = *density;
        if let (Motion::Dynamic(rigid), Some(density)) = (&mut self.motion, density) {
            *rigid = shape.rigid(density)?;
        }
        self.reshape(shape, density);
        Ok(())
    }

    fn reshape(&mut self, shape: Shape<S>, density: Option<S>) {
        self.surface = shape.surface().cloned();
        self.field = Some(Arc::clone(shape.field()));
        self.matter = Some(DensityShape { shape, density });
    }

    /// Sets all dimensions of its shape, as many as it has, and leaves the mass properties as they are.
    pub(crate) fn set_dimensions(&mut self, dimensions: Vec<S>) -> Result<(), ShapeError> {
        if let Some(DensityShape { shape, density }) = &self.matter {
            let (shape, density) = (shape.with_dimensions(dimensions)?, *density);
            self.reshape(shape, density);
        }
        Ok(())
    }

    /// The numbers of its shape's dimensions.
    pub(crate) fn dimensions(&self) -> &[S] {
        self.matter.as_ref().map_or(&[], |matter| matter.shape.dimension_values())
    }

    /// The shape that it is made of, if any.
    pub fn shape(&self) -> Option<&Shape<S>> {
        self.matter.as_ref().map(|matter| &matter.shape)
    }
}
