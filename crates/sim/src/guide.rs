//! From a world in ten lines to gradients of long rollouts.
//!
//! # A world
//! Bodies, what touches what, gravity. Samples of one body's surface touch the distance field of another; a field is a
//! grid made of a mesh ([`SdfGrid`](prehend_geometry::SdfGrid)) or a few lines of your own:
//!
//! ```
//! use std::sync::Arc;
//!
//! use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
//! use prehend_geometry::{DistanceField, FieldSample};
//! use prehend_sim::{
//!     Body, Horizon, Onset, Penalty, RigidBody, SemiImplicitEuler, State, Surface, World,
//! };
//!
//! /// The half-space z < 0.
//! struct Floor;
//!
//! impl DistanceField for Floor {
//!     fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
//!         let (distance, gradient, hessian) = (point.z, Vector3::z(), Matrix3::zeros());
//!         (distance <= reach).then_some(FieldSample { distance, gradient, hessian })
//!     }
//! }
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let rigid = RigidBody::new(0.2, Matrix3::identity() * 1e-4, Point3::origin())?;
//! let feet = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
//! let feet = feet.map(|(x, y)| Point3::new(0.03 * x, 0.03 * y, -0.02));
//!
//! let mut world = World::new(Vector3::new(0.0, 0.0, -9.81));
//! let floor = world.add(Body::held("floor").with_field(Arc::new(Floor)));
//! let surface = Surface::uniform(&feet, 4e-4)?;
//! let stool = world.add(Body::free("stool", rigid).with_surface(surface));
//! let law = Arc::new(Penalty::new(1e7, 1e5, 0.5, 1e-2)?);
//! world.touch(stool, floor, law, Onset::Softplus { width: 5e-5 })?;
//!
//! let mut start = vec![State::at_rest(Isometry3::identity()); 2];
//! start[stool].pose.translation.z = 0.02;
//! start[stool].linear.x = 0.3;
//! world.check_time_step(&start, 1e-3)?;
//! let horizon = Horizon { dt: 1e-3, steps: 200 };
//! let end = world.simulate(&SemiImplicitEuler, &start, horizon, |_, _| ())?;
//! // It slid to a halt: v²/2μg.
//! let slid = end[stool].pose.translation.x;
//! assert!((slid - 0.3 * 0.3 / (2.0 * 0.5 * 9.81)).abs() < 2e-3, "{slid}");
//! # Ok(())
//! # }
//! ```
//!
//! [`Body::driven`] puts a body on a course of its own, such as a robot's link; [`World::touch_both_ways`] is for two
//! bodies that both have samples and fields.
//!
//! # A law of your own
//! One function over the scalar, from gap and velocity to force ([`ContactLaw`](crate::ContactLaw)). What it calls its
//! parameters can carry derivatives. The example `custom_contact_law` does this and what follows.
//!
//! # Gradients, forward
//! Write what you want to know once over the scalar: [`World::lift`] makes constants of a world, and any of its numbers may then
//! be replaced by one that carries derivatives. [`Fwd`](prehend_autodiff::Fwd) is for few inputs. A mass or inertia is
//! replaced together with its body: [`RigidBody::new`]. All numbers in a row: [`World::numbers`].
//!
//! ```
//! # use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
//! use prehend_autodiff::{Fwd, Recording, Scalar};
//! use prehend_sim::{Compact, Integrator, Motion, SimulationError};
//! # use prehend_sim::{Body, Horizon, RigidBody, SemiImplicitEuler, State, World};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let mut world = World::new(Vector3::new(0.0, 0.0, -9.81));
//! # let rigid = RigidBody::new(0.2, Matrix3::identity() * 1e-4, Point3::origin())?;
//! # let ball = world.add(Body::free("ball", rigid));
//! # world.bodies[ball].load.z = 1.0;
//! # let start = [State::at_rest(Isometry3::identity())];
//! # let horizon = Horizon { dt: 1e-3, steps: 100 };
//! // Height after a while, by the speed at the start and the mass.
//! fn height<S: Scalar>(
//!     world: &World,
//!     start: &[State],
//!     integrator: &impl Integrator,
//!     [speed, mass]: [S; 2],
//!     horizon: Horizon,
//! ) -> Result<S, SimulationError> {
//!     let mut world = world.lift::<S>();
//!     if let Motion::Free(body) = &mut world.bodies[0].motion {
//!         *body = RigidBody::new(mass, *body.inertia(), *body.com())
//!             .map_err(|error| SimulationError::Body { body: "ball".to_owned(), error })?;
//!     }
//!     let mut start: Vec<State<S>> = start.iter().map(State::lift).collect();
//!     start[0].linear.z = speed;
//!     let end = world.simulate(integrator, &start, horizon, |_, _| ())?;
//!     Ok(end[0].pose.translation.z)
//! }
//!
//! let forward =
//!     height(&world, &start, &SemiImplicitEuler, Fwd::<2>::variables([0.5, 0.2]), horizon)?;
//! assert!((forward.derivative[0] - 0.1).abs() < 1e-12);
//!
//! // Reverse mode, for many inputs: the same function, with one node a step.
//! let integrator = Compact::new(SemiImplicitEuler, &world)?;
//! let recording = Recording::start();
//! let inputs = recording.variables([0.5, 0.2]);
//! let adjoints =
//!     recording.gradient(height(&world, &start, &integrator, inputs, horizon)?);
//! assert!((adjoints.wrt(inputs[1]) - forward.derivative[1]).abs() < 1e-12);
//! # Ok(())
//! # }
//! ```
//!
//! A rollout over [`Var`](prehend_autodiff::Var) with a plain integrator gives the same gradient and records every operation;
//! [`Compact`](crate::Compact) keeps a few hundred bytes a step. For rollouts too long even for that,
//! [`World::simulate_checkpointed`] is one node that holds as many states as you allow.
//!
//! # Together with other losses
//! The states of a rollout over `Var` are numbers on the tape like all others. Their poses go on into a renderer's
//! operation, a network or a sum of squares, where they come from may be anything as well, and one sweep goes back
//! through all of it. Loads that a controller computes from the states are one more line between two steps:
//!
//! ```
//! # use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
//! # use prehend_autodiff::{Recording, Var};
//! # use prehend_sim::*;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let mut world = World::new(Vector3::zeros());
//! # let rigid = RigidBody::new(0.2, Matrix3::identity() * 1e-4, Point3::origin())?;
//! # let ball = world.add(Body::free("ball", rigid));
//! let integrator = Compact::new(SemiImplicitEuler, &world)?;
//! let recording = Recording::start();
//! let gain = recording.variable(2.0);
//! let mut lifted = world.lift::<Var>();
//! let mut states = vec![State::at_rest(Isometry3::translation(1.0, 0.0, 0.0)).lift()];
//! let mut loss = Var::from(0.0);
//! for index in 0..30 {
//!     lifted.bodies[ball].load.x = -gain * states[ball].pose.translation.x;
//!     states = lifted.step(&integrator, &states, Step { index, dt: 1e-2 })?;
//!     loss += states[ball].pose.translation.vector.norm_squared();
//! }
//! // A stiffer spring brings it back sooner.
//! assert!(recording.gradient(loss).wrt(gain) < 0.0);
//! # Ok(())
//! # }
//! ```
//!
//! # What derivatives mean
//! Those of [`Onset::Hard`](crate::Onset::Hard) are exact for the steps that were taken, but the moment of an impact jumps from one
//! step to the next; [`Onset::Softplus`](crate::Onset::Softplus) makes the contact smooth, and fields should be C².
//! Derivatives of [`Onset::Leaky`](crate::Onset::Leaky) are not those of the forces, on purpose. At rest, at gap zero and
//! where a field has no gradient they are finite.
#[cfg(doc)]
use crate::{Body, RigidBody, World};
