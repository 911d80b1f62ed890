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
mod error;
pub mod fields;
mod first_order;
pub mod guide;
mod handle;
mod integrator;
pub mod joint_law;
mod linearize_step;
mod magnitude;
mod model;
pub mod prelude;
pub mod robot;
mod rollout;
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

pub use articulated::JointState;
pub use batch::Batch;
pub use body::RigidBody;
pub use body::error::BodyError;
pub use body_state::BodyState;
pub use contact::{
    BristleFriction, ContactCalibration, ContactForce, ContactKinematics, ContactLaw, Coulomb,
    DynContactLaw, GapSmoothing, HuntCrossley, KelvinVoigt, Law,
};
pub use diagnostics::Resolution;
pub use error::{BuildError, Result, SimulationError};
pub use handle::{BodyId, BushingId, ContactId, JointForceId};
pub use integrator::Integrator;
pub use integrator::adaptive::Adaptive;
pub use integrator::backward_euler::BackwardEuler;
pub use integrator::runge_kutta::classic::RungeKutta4;
pub use integrator::semi_implicit::SemiImplicitEuler;
pub use integrator::step_checkpointed::StepCheckpointed;
pub use integrator::sub_stepped::SubStepped;
pub use linearize_step::LinearizedStep;
pub use model::Model;
pub use model::articulated_body::ArticulatedBody;
pub use model::body::{Body, Motion};
pub use model::bushing::{Bushing, BushingStiffness};
pub use model::contact_group::ContactGroup;
pub use model::contact_pair::{ContactBodies, ContactPair};
pub use model::generalized_coordinates::StatePlaces;
pub use model::joint_force::{JointAxis, JointForce};
pub use model::material::Material;
pub use model::point_contact::PointContact;
pub use model::trajectory::Trajectory;
pub use model::transmission::Transmissions;
pub use rollout::{ControlResult, Simulation, StepError};
pub use rollout_function::{RolloutFunction, RolloutGradient, RolloutInputs};
pub use shape::Shape;
pub use shape::error::ShapeError;
pub use shape::options::ShapeOptions;
pub use state::State;
pub use surface::{Surface, SurfacePoint};
pub use time::{Step, TimeSteps};
