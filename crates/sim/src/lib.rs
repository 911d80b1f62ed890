//! Differentiable penalty-based rigid contact simulation.
//!
//! A rigid [`RigidBody`] carries surface samples ([`SurfacePoint`]) that touch a
//! [`DistanceField`](prehend_geometry::DistanceField). A [`ContactLaw`], written once over a generic scalar, turns gap and slip into
//! force; an [`Onset`] says how contact begins. Forces and their derivatives are gathered into one
//! wrench a step ([`contact::wrench`]), so that a rollout of a [`World`] carries exact derivatives by its initial states
//! and by every number of the world. [`StabilityLoss`] measures by such rollouts how far an object is from resting.
//!
//! The [`guide`] goes from a world in ten lines to gradients of long rollouts.
//!
//! World-frame conventions: a pose perturbation is the left twist (translation, rotation) about the
//! center of mass, velocities are those of the center of mass, in the world frame.

mod adjoint;
mod body;
pub mod contact;
mod equilibrium;
mod error;
#[cfg(test)]
mod fields;
#[cfg(test)]
mod gradients;
pub mod guide;
mod integrator;
mod near;
mod numbers;
mod robot;
mod rollout;
#[cfg(test)]
mod scenes;
mod smoothing;
mod stability;
mod state;
mod surface;
mod time_step;
mod world;

pub use adjoint::Compact;
pub use body::{BodyError, RigidBody};
pub use contact::LawError;
pub use contact::approach::{ApproachDamped, ApproachPenalty};
pub use contact::friction::regularized_coulomb;
pub use contact::grain::Grained;
pub use contact::graspd::GraspD;
pub use contact::hertz::{Hertz, HertzPenalty};
pub use contact::hunt_crossley::{HuntCrossley, HuntCrossleyPenalty};
pub use contact::law::{Contact, ContactLaw, Isotropic, IsotropicLaw, LocalLaw, Response};
pub use contact::onset::{LeakSteps, Onset, OnsetSample};
pub use contact::patch::Patch;
pub use contact::penalty::{KelvinVoigt, Penalty};
pub use contact::registry::{LawEntry, LawParameter, LawRegistry};
pub use contact::resting::RestingContact;
pub use contact::stribeck::Stribeck;
pub use contact::wrench::WrenchJacobian;
pub use equilibrium::{
    Balance, CompliantBalance, CompliantSupport, Equilibrium, Support, friction_factor,
};
pub use error::SimulationError;
pub use integrator::{
    BackwardEuler, Integrator, RungeKutta4, SemiImplicitEuler, SubStepped, VelocityVerlet,
};
pub use robot::JointState;
pub use rollout::Horizon;
pub use smoothing::{SmoothedGradient, Smoothing, SmoothingError};
pub use stability::{Averaging, Perturbation, StabilityJacobian, StabilityLoss, StabilityWeights};
pub use state::State;
pub use surface::{Surface, SurfacePoint};
pub use time_step::StepError;
pub use world::{Body, ContactPair, Course, Motion, Step, World};
