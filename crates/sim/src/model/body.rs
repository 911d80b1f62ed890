//! A body of a model: what moves it and how it touches others.

use std::sync::Arc;

use nalgebra::{Point3, Vector6};
use prehend_autodiff::Scalar;
use prehend_geometry::DistanceField;

use super::shaped_body::DensityShape;
use super::trajectory::{self, Trajectory};
use crate::body::RigidBody;
use crate::body::error::BodyError;
use crate::fields::Cuboid;
use crate::surface::Surface;

/// Body of a model: what moves it, and its surface and field for contact.
#[derive(Clone)]
pub struct Body<S: Scalar = f64> {
    /// Name, for messages.
    pub name: String,
    /// Kind of its motion.
    pub motion: Motion<S>,
    /// Samples of its surface, in its body frame: with them it touches the fields of others.
    pub surface: Option<Arc<Surface>>,
    /// Signed distance to it, in its body frame: what the samples of others touch.
    pub field: Option<Arc<dyn DistanceField>>,
    /// Force \[N\] and torque about the center of mass \[N m\] besides gravity and contacts, world frame; of a link about the origin of its
    /// frame.
    pub external_wrench: Vector6<S>,
    /// Shape and density, where its surface and field come from a shape.
    pub(crate) matter: Option<DensityShape<S>>,
}

/// Kind of a body's motion.
#[derive(Clone)]
pub enum Motion<S: Scalar = f64> {
    /// Forces, on a body with these mass properties.
    Dynamic(RigidBody<S>),
    /// Nothing but whoever sets its state. A body that touches it feels the state's velocity, a conveyor's for instance.
    Fixed,
    /// A trajectory, whatever the forces. In a model of numbers with derivatives one that carries them may take its place.
    Kinematic(Arc<dyn Trajectory<S>>),
    /// The joint that it hangs on, as a link of one of the model's [articulations](crate::Model::add_articulation). Its body frame is the link's.
    Link,
}

impl<S: Scalar> Body<S> {
    fn new(name: &str, motion: Motion<S>) -> Self {
        let external_wrench = Vector6::zeros();
        Self {
            name: name.to_owned(),
            motion,
            surface: None,
            field: None,
            external_wrench,
            matter: None,
        }
    }

    /// A body that forces move.
    pub fn dynamic(name: &str, body: RigidBody<S>) -> Self {
        Self::new(name, Motion::Dynamic(body))
    }

    /// A body that keeps the state it is given. Its center of mass is the origin of its body frame.
    pub fn fixed(name: &str) -> Self {
        Self::new(name, Motion::Fixed)
    }

    /// A body on a trajectory. Its center of mass is the origin of its body frame.
    pub fn kinematic(name: &str, trajectory: impl Trajectory<S>) -> Self {
        Self::new(name, Motion::Kinematic(Arc::new(trajectory)))
    }

    /// A link.
    pub(super) fn link(name: &str) -> Self {
        Self::new(name, Motion::Link)
    }

    /// True if forces move it, alone or as a link.
    pub(crate) fn feels_forces(&self) -> bool {
        matches!(self.motion, Motion::Dynamic(_) | Motion::Link)
    }

    /// Body with samples of its surface.
    #[must_use]
    pub fn with_surface(mut self, surface: impl Into<Arc<Surface>>) -> Self {
        self.surface = Some(surface.into());
        self
    }

    /// Body with a distance field, in its body frame.
    #[must_use]
    pub fn with_field(mut self, field: Arc<dyn DistanceField>) -> Self {
        self.field = Some(field);
        self
    }

    /// Body as a box around the origin of its body frame: its field, and samples at distances of `spacing` \[m\] at most.
    ///
    /// # Errors
    /// See [`Cuboid::surface`].
    pub fn with_cuboid(self, cuboid: Cuboid, spacing: f64) -> Result<Self, BodyError> {
        Ok(self.with_surface(cuboid.surface(spacing)?).with_field(Arc::new(cuboid)))
    }

    /// Its mass properties, if forces move it.
    #[inline]
    pub fn rigid(&self) -> Option<&RigidBody<S>> {
        match &self.motion {
            Motion::Dynamic(body) => Some(body),
            Motion::Fixed | Motion::Kinematic(_) | Motion::Link => None,
        }
    }

    /// Center of mass in the body frame \[m\].
    #[inline]
    pub fn com(&self) -> Point3<S> {
        self.rigid().map_or_else(Point3::origin, |body| *body.com())
    }

    /// Body, each number through `f`, but for a trajectory, which becomes one of constants.
    pub(super) fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> Body<T> {
        Body {
            name: self.name.clone(),
            motion: match &self.motion {
                Motion::Dynamic(rigid) => Motion::Dynamic(rigid.map(&f)),
                Motion::Fixed => Motion::Fixed,
                Motion::Link => Motion::Link,
                Motion::Kinematic(trajectory) => {
                    Motion::Kinematic(trajectory::constant(trajectory))
                }
            },
            surface: self.surface.clone(),
            field: self.field.clone(),
            external_wrench: self.external_wrench.map(&f),
            matter: self.matter.as_ref().map(|matter| matter.map(&f)),
        }
    }
}
