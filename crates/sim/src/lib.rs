//! Differentiable penalty-based rigid contact simulation.
//!
//! A rigid [`RigidBody`] carries surface samples ([`SurfacePoint`]) that touch a
//! [`DistanceField`](prehend_geometry::DistanceField). A [`ContactLaw`], written once over a generic scalar, turns gap and slip into
//! force; an [`Onset`] says how contact begins. Forces and their derivatives are gathered into one
//! wrench a step ([`contact::wrench`]), so that a [`World`]'s rollout carries exact derivatives with respect
//! to its initial pose. [`StabilityLoss`] measures by such rollouts how far an object is from resting.
//!
//! World-frame conventions: a pose perturbation is the left twist (translation, rotation) about the
//! centre of mass, velocities are those of the centre of mass, in the world frame.

mod body;
pub mod contact;
mod error;
#[cfg(test)]
mod fields;
mod integrator;
mod rollout;
#[cfg(test)]
mod scenes;
mod smoothing;
mod stability;
mod state;
mod surface;
mod time_step;
mod world;

pub use body::{BodyError, RigidBody};
pub use contact::friction::regularised_coulomb;
pub use contact::graspd::GraspD;
pub use contact::law::{Contact, ContactLaw, Isotropic, IsotropicLaw, LocalLaw, Response};
pub use contact::onset::{LeakSteps, Onset, OnsetSample};
pub use contact::penalty::{KelvinVoigt, LawError, Penalty};
pub use contact::registry::LawRegistry;
pub use contact::wrench::{Patch, WrenchJacobian};
pub use error::SimulationError;
pub use integrator::{Integrator, SemiImplicitEuler};
pub use rollout::Horizon;
pub use smoothing::{SmoothedGradient, Smoothing, SmoothingError};
pub use stability::{Averaging, Perturbation, StabilityJacobian, StabilityLoss, StabilityWeights};
pub use state::State;
pub use surface::{Surface, SurfacePoint};
pub use time_step::StepError;
pub use world::{Body, ContactPair, Course, Motion, Step, World};
