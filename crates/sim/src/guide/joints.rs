//! Joints and robots.
//!
//! Links that hang on each other by joints are bodies, too: they carry samples and fields and touch what others touch.
//! [`World::add_articulation`] adds them; what is free to move are the joints. Their states follow those of the bodies, so begin with
//! [`World::neutral_states`], set joints by [`World::set_joint`], and read them by [`World::joint_motion`]. States of links follow from them: what is written there is overwritten. Samples and
//! fields go to a link once it is there: `world.bodies[finger] = world.bodies[finger].clone().with_cuboid(shape, 0.005)?`.
//!
//! What acts along a joint is a [`JointLaw`](crate::joint_law::JointLaw): springs, dampers, dry friction, limits (no joint has any by itself), motors and servos. A
//! controller sets their parameters by name; they keep these values for the whole step, however it is divided, so that smooth targets want short steps. Over
//! numbers that carry derivatives, these pass through it; to end a run early it returns [`ControlFlow::Break`](std::ops::ControlFlow). A servo whose effort
//! is at its bound has a derivative of 0 by its target.
//!
//! ```
//! # use nalgebra::{Isometry3, Vector3};
//! # use prehend_autodiff::{Fwd, Scalar};
//! use prehend_sim::articulated::{Joint, Link};
//! use prehend_sim::joint_law::{JointLimits, Motor};
//! use prehend_sim::{Adaptive, RigidBody, State, Step, TimeSteps, World};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A rod of 0.5 m and 0.3 kg that hangs on a motor.
//! let rod = RigidBody::cuboid(0.3, [0.01, 0.01, 0.25])?.moved(&Isometry3::translation(0.0, 0.0, -0.25));
//! let mut world = World::new(Vector3::new(0.0, 0.0, -9.81));
//! let rod = world.add_articulation(vec![Link::new("rod", Joint::Revolute(Vector3::y_axis()), &rod)])?[0];
//! let motor = world.add_joint_force(rod, Motor { effort: 0.0 })?;
//! world.add_joint_force(rod, JointLimits { lower: -2.0, upper: 2.0, stiffness: 1e3, damping: 1.0 })?;
//!
//! // It is pushed the way it moves: how far does it get, and how does that depend on the push?
//! let push = Fwd::<1>::variable(0.2, 0);
//! let control = |_: Step, world: &mut World<Fwd<1>>, states: &mut [State<Fwd<1>>]| {
//!     let [_, velocity] = world.joint_motion(states, rod)?;
//!     let effort = if velocity.value() < 0.0 { -push } else { push };
//!     world.joint_force_mut(motor).set_param("effort", effort)?;
//!     Ok::<_, prehend_sim::SimulationError>(())
//! };
//! let lifted = world.cast();
//! let start = lifted.neutral_states();
//! let time_steps = TimeSteps { dt: 0.02, steps: 20 };
//! let end = lifted.simulate_controlled(&Adaptive::default(), &start, time_steps, control)?;
//! let [angle, _] = lifted.joint_motion(&end, rod)?;
//! assert!(angle.value > 0.1 && angle.derivative[0] > 0.1);
//! # Ok(())
//! # }
//! ```
//!
//! Trees have no loops: [`World::add_bushing`] closes them by springs. Robots of MJCF come by [`World::add_mjcf`], with joints, actuators, tendons and loops; those of
//! URDF ([`KinematicTree::from_urdf_file`](prehend_geometry::robot::KinematicTree::from_urdf_file)) by [`World::add_articulated_robot`], which names joints by the
//! links that they move, or by [`World::add_robot`] if their joints simply go where they are told. Sensors:
//! [`World::contact_wrench`], [`World::accelerometer`]. A joint type of your own is a function from coordinates to a pose
//! ([`JointModel`](crate::articulated::JointModel)). [`World::linearize_step`] gives a step with its Jacobian in closed form.
//!
//! For many inputs, such as a push per step, write the same over [`Var`](prehend_autodiff::Var): [`gradient`](prehend_autodiff::gradient) of a function of
//! them hands value and gradient to [`optimize`](prehend_autodiff::optimize) (`examples/pendulum_swing_up.rs`).
//!
//! Reverse mode keeps kinematics and dynamics of an articulation as one node each, whose adjoint is in closed form.
//! [`BackwardEuler`](crate::BackwardEuler) moves no joints;
//! [`SemiImplicitEuler`](crate::SemiImplicitEuler) does, and simulates a grasp with steps of 0.1 ms some ten times faster than the default. But
//! [`World::simulate_controlled`] says nothing of steps that are too long: ask [`World::check_time_step`]. What presses should hold with
//! [`BristleFriction`](crate::BristleFriction), as the guide's [contacts that hold](super#contacts-that-hold): under [`Coulomb`](crate::Coulomb) and a slip scale of 1 cm/s a gripped box slides by 5 mm in two
//! seconds.

#[cfg(doc)]
use crate::World;
