//! Differentiable penalty-based rigid contact simulation.
//!
//! A rigid [`RigidBody`] carries surface samples ([`SurfacePoint`]) that touch a
//! [`DistanceField`](prehend_geometry::DistanceField). A [`ContactLaw`], written once over a generic scalar, turns gap and
//! slip into force; a [`GapSmoothing`] says how contact begins. The built-in [`Law`]s are products of a [`NormalLaw`] and a
//! [`FrictionLaw`]. Forces and their derivatives are gathered into one wrench a step ([`contact::wrench`]), so that a
//! rollout of a [`World`] carries exact derivatives by its initial states and by every number of the world.
//! [`StabilityLoss`] measures by such rollouts how far an object is from resting.
//!
//! Links that joints hold together are [`articulated`]: they are bodies of a world like others, with laws along their joints
//! ([`JointLaw`]), contacts, loops ([`Weld`]) and sensors, from code, URDF or MJCF.
//!
//! The [`guide`] goes from a world in twenty lines to gradients of long rollouts.
//!
//! World-frame conventions: a pose perturbation is the left twist (translation, rotation) about the
//! center of mass, velocities are those of the center of mass, in the world frame.

#![cfg_attr(docsrs, feature(doc_cfg))]

mod adjoint;
pub mod articulated;
mod audit;
mod batch;
mod body;
mod broad_phase;
pub mod contact;
mod contact_frequency;
mod diagnosis;
mod equilibrium;
mod error;
pub mod fields;
mod first_order;
pub mod guide;
mod integrator;
mod joint_law;
mod law_report;
mod linear_step;
mod parameter_names;
mod parameters;
mod robot;
mod rollout;
mod rollout_function;
#[cfg(test)]
mod scenes;
mod shape;
mod smoothing;
mod stability;
mod state;
mod state_coordinates;
mod surface;
mod time;
mod world;

pub use adjoint::StepCheckpointed;
pub use audit::Resolution;
pub use batch::Batch;
pub use body::RigidBody;
pub use body::error::BodyError;
pub use contact::bristles::Bristles;
pub use contact::composite::Law;
pub use contact::dynamic::DynContactLaw;
pub use contact::error::LawError;
pub use contact::friction::anisotropic::AnisotropicFriction;
pub use contact::friction::coulomb::Coulomb;
pub use contact::friction::sticking::Sticking;
pub use contact::friction::stribeck::Stribeck;
pub use contact::friction::{FrictionCoefficient, FrictionLaw, regularized_coulomb};
pub use contact::gap_smoothing::{GapSmoothing, LeakSteps, SmoothedGap};
pub use contact::graspd::{GraspD, GraspDParameters};
pub use contact::law::ContactLaw;
pub use contact::normal::NormalLaw;
pub use contact::normal::approach_damped::ApproachDamped;
pub use contact::normal::hertz::Hertz;
pub use contact::normal::hunt_crossley::{Bounce, HuntCrossley};
pub use contact::normal::kelvin_voigt::KelvinVoigt;
pub use contact::parameters::{LawParameter, ParameterArray, Parameters};
pub use contact::patch::Patch;
pub use contact::point::{Contact, Response};
pub use contact::range::ParameterRange;
pub use contact::registry::{LawEntry, LawRegistry};
pub use contact::static_target::StaticContactTarget;
pub use contact::wrench::WrenchJacobian;
pub use contact_frequency::StepError;
pub use equilibrium::Equilibrium;
pub use equilibrium::balance::{Support, WrenchBalance, friction_factor};
pub use equilibrium::compliant::{CompliantBalance, CompliantSupport};
pub use equilibrium::pair_friction::PairFriction;
pub use error::SimulationError;
pub use fields::{Cuboid, HalfSpace, Placed, Sphere, SphereCavity};
pub use integrator::Integrator;
pub use integrator::adaptive::Adaptive;
pub use integrator::backward_euler::BackwardEuler;
pub use integrator::runge_kutta::classic::RungeKutta4;
pub use integrator::semi_implicit::SemiImplicitEuler;
pub use integrator::sub_stepped::SubStepped;
pub use integrator::velocity_verlet::VelocityVerlet;
pub use joint_law::JointLaw;
pub use joint_law::affine_actuator::AffineActuator;
pub use joint_law::damper::JointDamper;
pub use joint_law::dynamic::DynJointLaw;
pub use joint_law::friction::JointFriction;
pub use joint_law::limits::JointLimits;
pub use joint_law::motor::Motor;
pub use joint_law::muscle::{Muscle, MuscleActivation};
pub use joint_law::polynomial::{PolynomialDamper, PolynomialSpring};
pub use joint_law::position_servo::PositionServo;
pub use joint_law::registry::{JointLawEntry, joint_laws};
pub use joint_law::slack_spring::SlackSpring;
pub use joint_law::spring::JointSpring;
pub use joint_law::velocity_servo::VelocityServo;
pub use law_report::{Curve, Finding, LawReport, Verdict, law_report};
pub use linear_step::LinearStep;
pub use robot::driven::JointState;
pub use robot::mjcf::{MjcfError, MjcfOptions, MjcfRobot};
pub use robot::urdf::UrdfOptions;
pub use rollout::{ControlResult, Simulation};
pub use rollout_function::{RolloutFunction, RolloutGradient, RolloutInputs};
pub use shape::Shape;
pub use shape::error::ShapeError;
pub use shape::options::ShapeOptions;
pub use smoothing::{SmoothedGradient, Smoothing, SmoothingError};
pub use stability::{Averaging, Perturbation, StabilityJacobian, StabilityLoss, StabilityWeights};
pub use state::State;
pub use surface::{Surface, SurfacePoint};
pub use time::{Step, TimeSteps};
pub use world::World;
pub use world::articulated_body::ArticulatedBody;
pub use world::body::{Body, Motion};
pub use world::body_id::BodyId;
pub use world::contact_group::ContactGroup;
pub use world::contact_pair::{ContactBodies, ContactPair};
pub use world::joint_force::{JointAxis, JointForce, JointForceId};
pub use world::trajectory::Trajectory;
pub use world::transmission::Transmissions;
pub use world::weld::{Weld, WeldStiffness};
