//! Joints and robots.
//!
//! Links are bodies with samples and fields, connected by joints: [`Model::add_articulation`]. Begin with
//! [`Model::neutral_state`], set their generalized coordinates by [`Model::set_joint`], and read them by
//! [`Model::joint_motion`]. Poses of links follow from these and are overwritten. Add samples and fields afterwards:
//! `model.bodies[finger] = model.bodies[finger].clone().with_cuboid(shape, 0.005)?`.
//!
//! Forces along a joint are [`JointLaw`](crate::joint_law::JointLaw)s: springs, dampers, dry friction, limits (no joint has any by itself), motors and
//! servos. A controller sets their parameters by name, constant over a step and its substeps: smooth targets need short steps.
//! Derivatives pass through it; to end a run early it returns [`ControlFlow::Break`](std::ops::ControlFlow). A servo at its effort
//! bound has a derivative of 0 by its target.
//!
//! ```
//! # use nalgebra::{Isometry3, Vector3};
//! # use prehend_autodiff::{Fwd, Scalar};
//! use prehend_sim::articulated::{Joint, Link};
//! use prehend_sim::joint_law::{JointLimits, Motor};
//! use prehend_sim::{Adaptive, RigidBody, State, Step, TimeSteps, Model};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A rod of 0.5 m and 0.3 kg that hangs on a motor.
//! let rod = RigidBody::cuboid(0.3, [0.01, 0.01, 0.25])?.moved(&Isometry3::translation(0.0, 0.0, -0.25));
//! let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
//! let rod = model.add_articulation(vec![Link::new("rod", Joint::Revolute(Vector3::y_axis()), &rod)])?[0];
//! let motor = model.add_joint_force(rod, Motor { effort: 0.0 })?;
//! model.add_joint_force(rod, JointLimits { lower: -2.0, upper: 2.0, stiffness: 1e3, damping: 1.0 })?;
//!
//! // It is pushed the way it moves: how far does it get, and how does that depend on the push?
//! let push = Fwd::<1>::variable(0.2, 0);
//! let control = |_: Step, model: &mut Model<Fwd<1>>, state: &mut State<Fwd<1>>| {
//!     let [_, velocity] = model.joint_motion(state, rod)?;
//!     let effort = if velocity.value() < 0.0 { -push } else { push };
//!     model.joint_force_mut(motor).set_param("effort", effort)?;
//!     Ok::<_, prehend_sim::SimulationError>(())
//! };
//! let lifted = model.cast();
//! let start = lifted.neutral_state();
//! let time_steps = TimeSteps { dt: 0.02, steps: 20 };
//! let run = lifted.simulate_controlled(&Adaptive::default(), &start, time_steps, control)?;
//! let [angle, _] = lifted.joint_motion(&run.states, rod)?;
//! assert!(angle.value > 0.1 && angle.derivative[0] > 0.1);
//! # Ok(())
//! # }
//! ```
//!
//! [`Model::add_bushing`] closes loops by springs. Robots of MJCF: [`Model::add_mjcf`], with joints, actuators, tendons and loops; of
//! URDF ([`KinematicTree::from_urdf_file`](prehend_geometry::robot::KinematicTree::from_urdf_file)): [`Model::add_articulated_robot`], which names joints by the
//! links that they move; links on a given path are bodies [on a trajectory](super#bodies-on-a-trajectory). Sensors: [`Model::contact_wrench`], [`Model::accelerometer`]. A custom
//! joint type is a function from coordinates to a pose ([`JointModel`](crate::articulated::JointModel)). [`Model::linearize_step`] gives a
//! step with its Jacobian in closed form.
//!
//! For many inputs, such as a push per step, write the same over [`Var`](prehend_autodiff::Var), and hand its
//! [`gradient`](prehend_autodiff::gradient) to [`optimize`](prehend_autodiff::optimize) (`examples/pendulum_swing_up.rs`).
//!
//! Reverse mode keeps kinematics and dynamics of an articulation as one node each, whose adjoint is in closed form.
//! [`BackwardEuler`](crate::integrator::BackwardEuler) does not take joints. [`SemiImplicitEuler`](crate::SemiImplicitEuler) does, and simulates a grasp with
//! steps of 0.1 ms some ten times faster than the default. A closed grasp is stiffer than an open one: ask [`Model::check_time_step`] at a
//! state in grasp, or the report whether it `is_fine`; contacts chatter under longer steps, and forces mean nothing then. Grasps need [`BristleFriction`](crate::BristleFriction), see
//! [contacts that hold](super#contacts-that-hold): under [`Coulomb`](crate::Coulomb) with a slip scale of 1 cm/s a gripped box slides by 5 mm in two seconds.

#[cfg(doc)]
use crate::Model;
