//! Differentiable penalty-based rigid contact simulation.
//!
//! A rigid [`RigidBody`] carries surface samples ([`SurfacePoint`]) that touch a
//! [`DistanceField`](prehend_geometry::DistanceField). A [`ContactLaw`], written once over a generic scalar, turns gap and
//! slip into force; a [`GapSmoothing`] says how contact begins. The built-in [`Law`]s are products of a [`NormalLaw`](contact::NormalLaw) and a
//! [`FrictionLaw`](contact::FrictionLaw). Forces and their derivatives are gathered into one wrench a step, so that a
//! rollout of a [`Model`] carries exact derivatives by its initial states and by all [parameters](Model::parameters) of the model.
//!
//! Links that joints hold together are [`articulated`]: they are bodies of a model like others, with laws along their joints
//! ([`JointLaw`](joint_law::JointLaw)), contacts, loops ([`Bushing`]) and sensors, from code, URDF or MJCF.
//!
//! The [`guide`] goes from a model in twenty lines to gradients of long rollouts.
//!
//! World-frame conventions: a pose perturbation is the left twist (translation, rotation) about the
//! center of mass, velocities are those of the center of mass, in the world frame.

#![cfg_attr(docsrs, feature(doc_cfg))]

pub mod articulated;
mod batch;
mod body;
mod body_state;
pub mod contact;
mod diagnostics;
pub mod error;
pub mod fields;
mod first_order;
pub mod guide;
mod handle;
pub mod integrator;
pub mod joint_law;
mod linearize_step;
mod magnitude;
pub mod model;
pub mod prelude;
pub mod robot;
pub mod rollout;
mod rollout_function;
#[cfg(test)]
mod scenes;
mod shape;
mod spatial;
mod state;
mod surface;
mod time;

/// The version of parry whose shapes [`Shape::from_parry`] reads.
pub use parry3d_f64 as parry;

pub use batch::Batch;
pub use body::RigidBody;
pub use body_state::BodyState;
pub use contact::{
    BristleFriction, ContactCalibration, ContactForce, ContactKinematics, ContactLaw, Coulomb,
    DynContactLaw, GapSmoothing, HuntCrossley, KelvinVoigt, Law,
};
pub use diagnostics::Resolution;
pub use error::{BuildError, Result, SimulationError};
pub use handle::{BodyId, BushingId, ContactId, JointForceId};
pub use integrator::{Adaptive, Integrator, RungeKutta4, SemiImplicitEuler};
pub use linearize_step::LinearizedStep;
pub use model::{Body, Bushing, ContactBodies, JointForce, Material, Model, Motion};
pub use rollout::Simulation;
pub use rollout_function::{RolloutFunction, RolloutGradient, RolloutInputs};
pub use shape::Shape;
pub use shape::options::ShapeOptions;
pub use state::State;
pub use surface::{Surface, SurfacePoint};
pub use time::{Step, TimeSteps};
