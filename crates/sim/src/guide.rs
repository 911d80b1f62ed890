//! From a model in twenty lines to gradients of long rollouts.
//!
//! # A model
//! Gravity, bodies with shapes, and a [`Material`](crate::Material) for all contacts between them:
//!
//! ```
//! use nalgebra::Vector3;
//! use prehend_autodiff::Fwd;
//! use prehend_sim::{Body, Material, Model, Shape};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
//! model.add(Body::fixed_from_shape("floor", &Shape::half_space(Vector3::z_axis())?));
//! // Half extents [m], density [kg/m³].
//! let cube = model.add(Body::from_shape("box", &Shape::cuboid([0.02; 3])?, 500.0)?);
//! model.add_contacts(Material { friction: 0.4, ..Material::default() })?;
//!
//! let mut start = model.neutral_state();
//! start[cube].pose.translation.z = 0.02;
//! start[cube].linear.x = 0.5;
//! let end = model.simulate(&start, 0.3)?;
//! // It slides to a halt within v²/2μg.
//! let distance = 0.5 * 0.5 / (2.0 * 0.4 * 9.81);
//! assert!((end[cube].pose.translation.x / distance - 1.0).abs() < 0.02);
//!
//! // By the initial speed: v/μg.
//! let mut start = start.cast::<Fwd<1>>();
//! start[cube].linear.x = Fwd::variable(0.5, 0);
//! let end = model.cast().simulate(&start, 0.3)?;
//! let slope = end[cube].pose.translation.x.derivative[0];
//! assert!((slope / (0.5 / (0.4 * 9.81)) - 1.0).abs() < 0.02);
//! # Ok(())
//! # }
//! ```
//!
//! Points of contact with their forces: [`Model::point_contacts`]; scenes of files: [`Model::from_mjcf`].
//!
//! # Samples, fields and laws of your own
//! Samples of one body's surface touch the distance field of another; a field is a grid made of a mesh
//! ([`SdfGrid`](prehend_geometry::SdfGrid)), one of [`fields`](crate::fields), or a [`DistanceField`](prehend_geometry::DistanceField) of your
//! own:
//!
//! ```
//! use std::sync::Arc;
//!
//! use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
//! use prehend_sim::fields::HalfSpace;
//! use prehend_sim::{Body, ContactBodies, Coulomb, GapSmoothing, KelvinVoigt, Law, RigidBody, Surface, Model};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // 200 g; inertia in kg m², center of mass in m.
//! let com = Point3::new(0.0, 0.0, -5e-3);
//! let rigid = RigidBody::new(0.2, Matrix3::identity() * 1e-4, com)?;
//! let feet = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
//! let feet = feet.map(|(x, y)| Point3::new(0.03 * x, 0.03 * y, -0.02));
//!
//! let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
//! let floor = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
//! // Four feet of 1 cm² each.
//! let surface = Surface::uniform(&feet, 4e-4)?;
//! let stool = model.add(Body::dynamic("stool", rigid).with_surface(surface));
//! // Pressure per depth [N/m³] and per speed [N s/m³]: the stool sinks in by half a millimeter.
//! // What sticks creeps below 1 cm/s.
//! let spring = KelvinVoigt { stiffness: 1e7, damping: 1e5 };
//! let law = Law::new(spring, Coulomb { friction: 0.5, slip_scale: 1e-2 })?;
//! // Contact fades in over a tenth of that depth.
//! let bodies = ContactBodies { samples: stool, field: floor };
//! model.add_contact(bodies, Arc::new(law), GapSmoothing::Softplus { width: 5e-5 })?;
//!
//! let mut start = model.neutral_state();
//! model.set_pose(&mut start, stool, &Isometry3::translation(0.0, 0.0, 0.02))?;
//! start[stool].linear.x = 0.3;
//! let end = model.simulate(&start, 0.2)?;
//! // It slid to a halt: v²/2μg.
//! let slid = model.pose(&end, stool).translation.x;
//! assert!((slid - 0.3 * 0.3 / (2.0 * 0.5 * 9.81)).abs() < 3e-4, "{slid}");
//! # Ok(())
//! # }
//! ```
//!
//! The pose in a state is that of the center of mass: [`Model::set_pose`] sets it from the pose of the body's frame, and
//! [`Model::pose`] goes back, for renderers. For fixed and kinematic bodies the two are the same; a link's state is
//! the pose of its frame. A simulation begins at the [time](crate::State::time) of its state.
//!
//! Return `anyhow::Result` from `main`: it prints messages of errors, `Box<dyn Error>` only their fields.
//!
//! You choose no step: [`Model::simulate`] and [`Model::rollout`] (states at the times of [`TimeSteps`](crate::TimeSteps)) use
//! [`Adaptive::default`](crate::Adaptive), which holds tolerances of states and derivatives whatever the stiffness, or returns an
//! error. For [steps of your own](#steps-of-your-own-choice), ask [`Model::check_time_step`] before and
//! `simulate_with(…)?.resolution.is_fine()` afterwards; [`Model::simulate_controlled`] has no such report. Stiffness and damping
//! from depth at rest: [`ContactCalibration`](crate::ContactCalibration).
//!
//! # Bodies on a trajectory
//! The pose and velocity of a [`Body::kinematic`], such as a robot's link, are those of a [`Trajectory`](crate::model::Trajectory); its
//! initial state is ignored. Velocities must be the time derivatives of the pose; far from these, they are an error. Their own
//! derivatives are not checked: if the pose has a variable speed and the velocity is a constant, derivatives of all that touches
//! the body are wrong. Adaptive steps sample the trajectory at least every millisecond, and may miss shorter motions.
//!
//! ```
//! # use std::sync::Arc;
//! # use nalgebra::{Isometry3, Vector3};
//! # use prehend_autodiff::{Fwd, Scalar};
//! # use prehend_sim::prelude::*;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let mut model = Model::new(Vector3::zeros());
//! let table = model.add(Body::kinematic("table", |time: f64| {
//!     let mut state = BodyState::at_rest(Isometry3::translation(0.1 * time, 0.0, 0.0));
//!     state.linear.x = 0.1; // What touches it feels this velocity.
//!     state
//! }));
//! let start = model.neutral_state();
//! let end = model.simulate(&start, 0.5)?;
//! assert!((end[table].pose.translation.x - 0.05).abs() < 1e-12);
//!
//! // By its speed: over numbers that carry derivatives, the same for all that it touches.
//! let speed = Fwd::<1>::variable(0.1, 0);
//! let mut lifted = model.cast();
//! lifted.bodies[table].motion = Motion::Kinematic(Arc::new(move |time: f64| {
//!     let mut state = BodyState::at_rest(Isometry3::identity());
//!     (state.pose.translation.x, state.linear.x) = (speed.times(time), speed);
//!     state
//! }));
//! let end = lifted.simulate(&start.cast(), 0.5)?;
//! assert!((end[table].pose.translation.x.derivative[0] - 0.5).abs() < 1e-12);
//! # Ok(())
//! # }
//! ```
//!
//! # Contacts that hold
//! Regularized [`Coulomb`](crate::Coulomb) friction lets sticking contacts creep, at v_s T/√(µ²N² − T²) for slip scale v_s, tangential
//! force T and normal force N. [`BristleFriction`](crate::BristleFriction) adds tangential springs and holds what rests deeper than a
//! thousandth of its `deflection`: use it for stacks and grasps. With derivatives it costs five to ten times as much; for sliding
//! and bouncing, `Coulomb` suffices, whose documentation says how to choose v_s.
//!
//! Samples of flat faces should be a lattice: [`Body::with_cuboid`] gives a box samples and field, so that boxes touch
//! each other; one that only stands on others may do with [`Surface::cuboid`](crate::Surface::cuboid). A ball is a single round sample
//! ([`Surface::ball`](crate::Surface::ball)). Solid, uniform bodies: [`RigidBody::cuboid`], [`RigidBody::ball`].
//!
//! ```
//! # use std::sync::Arc;
//! # use nalgebra::{Isometry3, Vector3};
//! # use prehend_sim::prelude::*;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A slope of 6°.
//! let mut model = Model::new(Vector3::new(1.0, 0.0, -9.75));
//! let floor = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
//! // Two boxes of 4 cm and 200 g with edges of 1 mm; samples 1 cm apart.
//! let (half, mass) = (0.02, 0.2);
//! let rigid = RigidBody::cuboid(mass, [half; 3])?;
//! let shape = Cuboid { half_extents: Vector3::repeat(half), rounding: 1e-3 };
//! let lower = model.add(Body::dynamic("lower", rigid).with_cuboid(shape, 0.01)?);
//! let upper = model.add(Body::dynamic("upper", rigid).with_cuboid(shape, 0.01)?);
//!
//! // Both weigh on the floor: a face of the lower one sinks in by a tenth of a millimeter.
//! let contact_area = 4.0 * half * half;
//! let target = ContactCalibration { mass: 2.0 * mass, gravity: 9.75, penetration: 1e-4, contact_area };
//! let normal = KelvinVoigt::from_target(&target, 0.3)?;
//! let friction = BristleFriction { friction: Coulomb { friction: 0.5, slip_scale: 1e-2 }, deflection: 1e-4 };
//! let law = Arc::new(Law::new(normal, friction)?);
//! let smoothing = GapSmoothing::Softplus { width: 1e-5 };
//! model.add_contact(ContactBodies { samples: lower, field: floor }, law.clone(), smoothing)?;
//! model.add_symmetric_contact(upper, lower, law, smoothing)?;
//!
//! let mut start = model.neutral_state();
//! start[lower].pose.translation.z = half;
//! start[upper].pose.translation.z = 3.0 * half;
//! let run = model.rollout(&start, TimeSteps { dt: 1.0, steps: 3 })?;
//! let place = |second: usize| run[second][upper].pose.translation.x;
//! assert!((place(3) - place(1)).abs() < 1e-7);
//! # Ok(())
//! # }
//! ```
//!
//! # Joints and robots
//! Arms, doors, hands and grippers: module [`joints`], in `crates/sim/src/guide/joints.rs`.
//!
//! # Symmetric contact
//! If both bodies have samples and fields, each one's samples touch the other's field, with half of the force. Penetration is
//! tested at samples, not where edges cross between them: keep the sample spacing below half of the smaller body's edges, or
//! turned boxes may pass through each other. The directions are two contacts, along the axes of their own field's body;
//! [`Model::set_contact_param`] sets a parameter of both.
//!
//! ```
//! # use std::sync::Arc;
//! # use nalgebra::{Isometry3, Matrix3, Point3, Vector1, Vector3};
//! # use prehend_autodiff::{Fwd, Scalar};
//! # use prehend_sim::prelude::*;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let rigid = RigidBody::new(0.2, Matrix3::identity() * 1e-4, Point3::origin())?;
//! # let surface = Arc::new(Surface::uniform(&[Point3::origin()], 1e-4)?);
//! # let mut model = Model::new(Vector3::zeros());
//! // Half-spaces, for brevity, the upper one upside down.
//! let body = |name| Body::dynamic(name, rigid).with_surface(surface.clone()).with_field(Arc::new(HalfSpace::floor()));
//! let (lower, upper) = (model.add(body("lower")), model.add(body("upper")));
//! let spring = KelvinVoigt { stiffness: 1e7, damping: 1e5 };
//! let friction = Coulomb { friction: 0.5, slip_scale: 1e-2 };
//! let law = Law::new(spring, friction)?;
//! model.add_symmetric_contact(lower, upper, Arc::new(law), GapSmoothing::Hard)?;
//! let turned = Isometry3::new(Vector3::new(0.0, 0.0, -1e-3), Vector3::x() * std::f64::consts::PI);
//! let mut state = model.neutral_state();
//! model.set_pose(&mut state, upper, &turned)?;
//! // 1e7 N/m³ · 1 mm · 1 cm², half of it each way.
//! assert!((model.wrenches(&state, 0)[upper].z - 1.0).abs() < 1e-9);
//! # Ok(())
//! # }
//! ```
//!
//! # Steps of your own choice
//! Where speed counts more than certainty, [`Model::simulate_with`] takes the steps of an
//! [`Integrator`](crate::Integrator), and reports how well they resolved the motion, and the first body that passed through another
//! ([`Resolution`](crate::Resolution)).
//! An energy gain by contacts of more than a quarter of the largest kinetic energy is an error, as by default; it is not tested
//! with motors, kinematic bodies, or fixed ones with a velocity.
//!
//! [`SemiImplicitEuler`](crate::SemiImplicitEuler) is the cheapest. [`BackwardEuler`](crate::integrator::BackwardEuler) is stable for every
//! step, except where friction sticks, and damps faster motions: with steps of a millisecond it simulates a stack at rest two to
//! three times faster than the default. [`SubStepped`](crate::integrator::SubStepped) divides the steps of any integrator where contacts and
//! imminent impacts demand it. With steps that are too long, derivatives are exactly those of the steps and far from the motion's,
//! even where values look right.
//!
//! ```
//! # use std::sync::Arc;
//! # use nalgebra::{Isometry3, Matrix3, Point3, Vector1, Vector3};
//! # use prehend_autodiff::{Fwd, Scalar};
//! # use prehend_sim::prelude::*;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let rigid = RigidBody::new(0.2, Matrix3::identity() * 1e-4, Point3::origin())?;
//! # let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
//! # let floor = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
//! # let feet = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
//! # let feet = feet.map(|(x, y)| Point3::new(0.03 * x, 0.03 * y, -0.02));
//! # let surface = Surface::uniform(&feet, 4e-4)?;
//! # let stool = model.add(Body::dynamic("stool", rigid).with_surface(surface));
//! # let spring = KelvinVoigt { stiffness: 1e7, damping: 1e5 };
//! # let law = Arc::new(Law::new(spring, Coulomb { friction: 0.5, slip_scale: 1e-2 })?);
//! # let bodies = ContactBodies { samples: stool, field: floor };
//! # model.add_contact(bodies, law, GapSmoothing::Softplus { width: 5e-5 })?;
//! # let mut start = model.neutral_state();
//! # start[stool].pose.translation.z = 0.021;
//! let right = model.simulate(&start, 0.5)?;
//! let time_steps = TimeSteps { dt: 1e-2, steps: 50 };
//! let divided = SubStepped { integrator: SemiImplicitEuler, max_substeps: 256 };
//! let coarse = model.simulate_with(&BackwardEuler, &start, time_steps)?;
//! let finer = model.simulate_with(&divided, &start, time_steps)?;
//! for end in [&coarse.states, &finer.states] {
//!     assert!((end[stool].pose.translation.z - right[stool].pose.translation.z).abs() < 1e-4);
//! }
//! assert!(!coarse.resolution.is_fine());
//! println!("{}", coarse.resolution);
//! # Ok(())
//! # }
//! ```
//!
//! # A law of your own
//! One function over the scalar, from gap and velocity to force ([`ContactLaw`](crate::ContactLaw)), along the axes of
//! the body with the field. Its parameters can carry derivatives:
//!
//! ```
//! # use std::sync::Arc;
//! # use nalgebra::{Isometry3, Matrix3, Point3, Vector1, Vector3};
//! # use prehend_autodiff::{Fwd, Scalar};
//! # use prehend_sim::prelude::*;
//! /// Pressure k d² at depth d, drag −c N u at slip u: k [N/m⁴], c [s/m].
//! struct Wet([f64; 2]);
//!
//! impl ContactLaw for Wet {
//!     fn params(&self) -> &[f64] {
//!         &self.0
//!     }
//!     fn law<S: Scalar>(&self, p: &[S], contact: &ContactKinematics<S>) -> ContactForce<S> {
//!         let normal = p[0] * contact.gap * contact.gap * contact.area;
//!         ContactForce { normal, tangential: contact.slip * -(p[1] * normal) }
//!     }
//!     fn cutoff(&self) -> f64 {
//!         0.0
//!     }
//! }
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let rigid = RigidBody::new(0.2, Matrix3::identity() * 1e-4, Point3::origin())?;
//! # let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
//! # let floor = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
//! # let surface = Surface::uniform(&[Point3::origin()], 1e-4)?;
//! # let puck = model.add(Body::dynamic("puck", rigid).with_surface(surface));
//! # let mut start = model.neutral_state();
//! # start[puck].pose.translation.z = -1e-3;
//! # start[puck].linear.x = 0.3;
//!
//! let bodies = ContactBodies { samples: puck, field: floor };
//! model.add_contact(bodies, Arc::new(Wet([1.962e10, 0.5])), GapSmoothing::Hard)?;
//! let mut lifted = model.cast::<Fwd<1>>();
//! lifted.contacts[0].params_mut()[1].derivative = [1.0]; // Of the only contact.
//! let end = lifted.simulate(&start.cast(), 0.2)?;
//! // v = v₀ exp(−c g t), by c:
//! let speed = end[puck].linear.x;
//! assert!((speed.derivative[0] / (-9.81 * 0.2 * speed.value) - 1.0).abs() < 1e-4);
//! # Ok(())
//! # }
//! ```
//!
//! Longer: `examples/custom_contact_law.rs`.
//!
//! # Gradients, forward
//! Write the quantity once over the scalar: [`Model::cast`] makes constants of a model; then overwrite the inputs.
//! [`Fwd`](prehend_autodiff::Fwd) is for few. To vary mass, inertia or center of mass, replace the body's [`RigidBody`]. All numbers
//! as one vector: [`Model::parameters`]. If the center of mass varies at a fixed pose of the model, make the initial state by
//! [`RigidBody::at_rest`] of the new body.
//!
//! ```
//! # use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
//! use prehend_autodiff::{Fwd, Recording, Scalar};
//! use prehend_sim::{BuildError, Motion, SimulationError};
//! # use prehend_sim::{Body, RigidBody, State, Model};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
//! # let rigid = RigidBody::new(0.2, Matrix3::identity() * 1e-4, Point3::origin())?;
//! # let ball = model.add(Body::dynamic("ball", rigid));
//! # model.bodies[ball].external_wrench.z = 1.0;
//! # let start = model.neutral_state();
//! // Height after a while, by the speed at the start and the mass.
//! fn height<S: Scalar>(
//!     model: &Model,
//!     start: &State,
//!     [speed, mass]: [S; 2],
//! ) -> Result<S, SimulationError> {
//!     let mut model = model.cast::<S>();
//!     if let Motion::Dynamic(body) = &mut model.bodies[0].motion {
//!         *body = RigidBody::new(mass, *body.inertia(), *body.com())
//!             .map_err(|error| BuildError::Body { body: "ball".to_owned(), error })?;
//!     }
//!     let mut start: State<S> = start.cast();
//!     start[0].linear.z = speed;
//!     Ok(model.simulate(&start, 0.1)?[0].pose.translation.z)
//! }
//!
//! let forward = height(&model, &start, Fwd::<2>::variables([0.5, 0.2]))?;
//! assert!((forward.derivative[0] - 0.1).abs() < 1e-12);
//!
//! // Reverse mode, for many inputs: the same function.
//! let recording = Recording::start();
//! let inputs = recording.variables([0.5, 0.2]);
//! let adjoints = recording.gradient(height(&model, &start, inputs)?);
//! assert!((adjoints.wrt(inputs[1]) - forward.derivative[1]).abs() < 1e-12);
//! # Ok(())
//! # }
//! ```
//!
//! Memory of reverse mode, 10 000 steps of a free body on a fixed one:
//!
//! | call | a step | in all |
//! |---|--:|--:|
//! | `simulate_with(&SemiImplicitEuler, …)` over [`Var`](prehend_autodiff::Var) | 10 kB | 100 MB |
//! | the same, [`StepCheckpointed::new(SemiImplicitEuler, &model)?`](crate::integrator::StepCheckpointed) | 0.5 to 1.3 kB | 5 to 13 MB |
//! | [`RolloutFunction`](crate::RolloutFunction): `evaluate`, `vjp` | 104 bytes a body | 2 MB |
//!
//! The last two record one step of the rollout at a time, with [`Adaptive`](crate::Adaptive) all its substeps: give it many steps.
//!
//! # Identification
//! Parameters from observed motion, by nonlinear least squares. Where a trial step leads to an invalid model, such as one of
//! negative friction, return NaN residuals: the solver then tries a shorter step. Each trial costs a rollout: stop where the
//! predicted decrease is below the observations' noise ([`Criteria`](prehend_autodiff::optimize::Criteria)). Mass is not
//! identifiable from free sliding. Angles wrap: compare points of a body, and check the final cost.
//!
//! ```
//! # use std::sync::Arc;
//! # use nalgebra::{Isometry3, Vector3};
//! use prehend_autodiff::optimize::{Criteria, LevenbergMarquardt, NormalEquations};
//! use prehend_autodiff::{Fwd, Scalar};
//! # use prehend_sim::prelude::*;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
//! # let floor = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
//! # let rigid = RigidBody::cuboid(0.2, [0.02; 3])?;
//! # let block = Body::dynamic("block", rigid).with_surface(Surface::cuboid([0.02; 3], 0.02)?);
//! # let block = model.add(block);
//! # let bodies = ContactBodies { samples: block, field: floor };
//! # let spring = KelvinVoigt { stiffness: 1e7, damping: 1e5 };
//! # let law = Law::new(spring, Coulomb { friction: 0.5, slip_scale: 1e-2 })?;
//! let contact = model.add_contact(bodies, Arc::new(law), GapSmoothing::Softplus { width: 2e-5 })?;
//! # let mut start = model.neutral_state();
//! # start[block].pose.translation.z = 0.02;
//! // Where a block is every 20 ms, by its friction and its speed at the start.
//! fn places<S: Scalar>(
//!     model: &Model,
//!     start: &State,
//!     (block, contact): (BodyId, ContactId),
//!     [friction, speed]: [S; 2],
//! ) -> Result<Vec<S>, SimulationError> {
//!     let mut model = model.cast::<S>();
//!     model.set_contact_param(contact, "friction", friction)?;
//!     let mut start: State<S> = start.cast();
//!     start[block].linear.x = speed;
//!     let run = model.rollout(&start, TimeSteps { dt: 0.02, steps: 10 })?;
//!     Ok(run.iter().map(|states| states[block].pose.translation.x).collect())
//! }
//!
//! let seen = places(&model, &start, (block, contact), [0.35, 0.6])?;
//! let residuals = |x: &[Fwd<2>]| match places(&model, &start, (block, contact), [x[0], x[1]]) {
//!     Ok(places) => places.iter().zip(&seen).map(|(place, seen)| place.plus(-seen)).collect(),
//!     Err(_) => vec![Fwd::constant(f64::NAN); seen.len()],
//! };
//! // Half the sum of squares [m²]: places are known to a micrometer.
//! let criteria = Criteria { predicted_decrease: 1e-12, ..Criteria::default() };
//! let solver = LevenbergMarquardt { criteria, ..LevenbergMarquardt::default() };
//! let found = solver.minimize(&[0.6, 0.4], |x| NormalEquations::forward(residuals, x))?;
//! assert!((found.parameters[0] - 0.35).abs() < 1e-3 && (found.parameters[1] - 0.6).abs() < 1e-3);
//! assert!(found.iterations < 20);
//! # Ok(())
//! # }
//! ```
//!
//! # Together with other losses
//! States of a rollout over `Var` are numbers on the tape. Initial states may be computed on it, poses may be inputs of a renderer
//! or a network, and one reverse sweep differentiates the composition, with a controller between steps
//! ([`Model::simulate_controlled`]):
//!
//! ```
//! # use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
//! # use prehend_autodiff::{Recording, Var};
//! # use prehend_sim::prelude::*;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let mut model = Model::new(Vector3::zeros());
//! # let rigid = RigidBody::new(0.2, Matrix3::identity() * 1e-4, Point3::origin())?;
//! # let ball = model.add(Body::dynamic("ball", rigid));
//! let recording = Recording::start();
//! let gain = recording.variable(2.0);
//! let mut start = model.neutral_state();
//! start[ball].pose.translation.x = 1.0;
//! let mut loss = Var::from(0.0);
//! let control = |step: Step, model: &mut Model<Var>, state: &mut State<Var>| {
//!     if step.start >= 0.1 {
//!         model.bodies[ball].external_wrench.x = -gain * state[ball].pose.translation.x;
//!     }
//!     loss += state[ball].pose.translation.vector.norm_squared();
//! };
//! let time_steps = TimeSteps { dt: 1e-2, steps: 30 };
//! model.cast().simulate_controlled(&Adaptive::default(), &start.cast(), time_steps, control)?;
//! // A stiffer spring brings it back sooner.
//! assert!(recording.gradient(loss).wrt(gain) < 0.0);
//! # Ok(())
//! # }
//! ```
//!
//! # Contacts not yet made
//! [`GapSmoothing::Leaky`](crate::GapSmoothing::Leaky) has the forces of [`GapSmoothing::Hard`](crate::GapSmoothing::Hard). In
//! gradients, the gap of samples up to `band` \[m\] away has slope α (`alpha` \[1\], 0 to 1) instead of 0:
//!
//! ```
//! # use std::sync::Arc;
//! # use nalgebra::{Isometry3, Matrix3, Point3, Vector1, Vector3};
//! # use prehend_autodiff::{Fwd, Scalar};
//! # use prehend_sim::prelude::*;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let rigid = RigidBody::new(0.2, Matrix3::identity() * 1e-4, Point3::origin())?;
//! # let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
//! # let floor = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
//! # let surface = Surface::uniform(&[Point3::origin()], 4e-4)?;
//! # let stool = model.add(Body::dynamic("stool", rigid).with_surface(surface));
//! # let spring = KelvinVoigt { stiffness: 1e7, damping: 1e5 };
//! # let law = Arc::new(Law::new(spring, Coulomb { friction: 0.5, slip_scale: 1e-2 })?);
//! use prehend_sim::contact::LeakSteps;
//!
//! let smoothing = GapSmoothing::Leaky { alpha: 0.1, band: 5e-3, steps: LeakSteps::All };
//! model.add_contact(ContactBodies { samples: stool, field: floor }, law, smoothing)?;
//! # let mut state = model.neutral_state();
//! # state[stool].pose.translation.z = 1e-3;
//! let mut lifted: State<Fwd<1>> = state.cast();
//! lifted[stool].pose.translation.z.derivative = [1.0];
//! let force = model.cast().wrenches(&lifted, 0)[stool].z;
//! assert!(force.value == 0.0 && force.derivative[0] < 0.0);
//! # Ok(())
//! # }
//! ```
//!
//! # What derivatives mean
//! Derivatives are those of the substeps taken. [`Adaptive`](crate::Adaptive) substeps (default) are so short that these equal the
//! motion's to 0.05 % through a bounce. With an integrator of your own they are those of its steps: under
//! [`GapSmoothing::Hard`](crate::GapSmoothing::Hard) the time of an impact jumps from one step to the next, and steps too long for
//! friction make them meaningless ([`Resolution`](crate::Resolution)).
//!
//! Forces must begin at zero: fields should be C², and damping should fade in, by
//! [`GapSmoothing::Softplus`](crate::GapSmoothing::Softplus) or by the law. `Adaptive` tests each contact once, at 1 m/s: a jump at
//! touch is an error. Discontinuities in depth or slip, and kinks of a field, are not detected.
//!
//! [`GapSmoothing::Leaky`](crate::GapSmoothing::Leaky) is an exception. At rest, at gap zero and where a field has no gradient,
//! derivatives are finite.

pub mod joints;

#[cfg(doc)]
use crate::{Body, Model, RigidBody};
