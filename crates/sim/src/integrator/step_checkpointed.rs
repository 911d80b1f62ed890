//! Reverse mode through rollouts: one node a step.

use std::sync::Arc;

#[cfg(doc)]
use prehend_autodiff::Var;
use prehend_autodiff::{Recompute, Scalar};

use super::Integrator;
use super::world_template::{ParameterDelta, WorldTemplate};
use crate::body_state::{BodyState, Rows, STATE, coordinates_of, states_of};
use crate::error::{Result, SimulationError};
use crate::state::State;
use crate::time::Step;
use crate::world::World;

/// An integrator each of whose steps [`Var`] records as one node.
///
/// The node keeps the numbers that the step began with, and the sweep records the step again: some 540 bytes for a free
/// body on a fixed one, 1330 if every parameter of their world varies, where plain recording takes 10 kB. States, masses, centers
/// of mass, external wrenches, gravity and parameters of laws may come from anywhere on the tape and may be others at each step.
/// Numbers without derivatives are simulated by `integrator` as it is.
///
/// ```
/// # use std::sync::Arc;
/// # use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
/// # use prehend_autodiff::{Recording, Var};
/// # use prehend_sim::prelude::*;
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let mut world = World::new(Vector3::new(0.0, 0.0, -9.81));
/// # let rigid = RigidBody::new(0.2, Matrix3::identity() * 1e-4, Point3::origin())?;
/// # let ball = world.add(Body::dynamic("ball", rigid));
/// let recording = Recording::start();
/// let mut lifted = world.cast::<Var>();
/// lifted.gravity.z = recording.variable(-9.81);
/// let start = world.neutral_state().cast();
/// let integrator = StepCheckpointed::new(SemiImplicitEuler, &world)?;
/// let end = lifted.simulate_with(&integrator, &start, TimeSteps { dt: 1e-3, steps: 1000 })?.states;
/// let by_gravity = recording.gradient(end[ball].linear.z).wrt(lifted.gravity.z);
/// assert!((by_gravity - 1.0).abs() < 1e-12);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct StepCheckpointed<I> {
    template: Arc<WorldTemplate<I>>,
}

impl<I: Integrator> StepCheckpointed<I> {
    /// `integrator` for `world` and others that differ from it in parameters only.
    ///
    /// # Errors
    /// If a body of the world has an impossible mass, inertia or center of mass, or a trajectory carries derivatives.
    pub fn new<S: Scalar>(integrator: I, world: &World<S>) -> Result<Self> {
        Ok(Self { template: WorldTemplate::new(integrator, world)? })
    }

    /// Steps of a world of `template`.
    pub(crate) fn of(template: &Arc<WorldTemplate<I>>) -> Self {
        Self { template: Arc::clone(template) }
    }
}

impl<I: Integrator + Send + 'static> Integrator for StepCheckpointed<I> {
    /// # Errors
    /// As the integrator within; if the world differs from the one of [`StepCheckpointed::new`] in more than parameters, or a
    /// trajectory carries derivatives.
    fn step<S: Scalar>(&self, world: &World<S>, state: &State<S>, step: Step) -> Result<State<S>> {
        if S::ORDER == 0 {
            return world.integrate(&self.template.integrator, state, step);
        }
        world.check_trajectories()?;
        if !self.template.is_of(world) {
            return Err(SimulationError::AnotherWorld);
        }
        self.check_differentiable(world)?;
        let (function, x) = OneStep::new(&self.template, world, state.rows(), step);
        let after = S::recompute(function, &x)?;
        Ok(state.with(with_moved(world, state.rows(), &after), step.end()))
    }

    fn check_differentiable<S: Scalar>(&self, world: &World<S>) -> Result<()> {
        self.template.integrator.check_differentiable(world)
    }

    fn stability_limit(&self) -> f64 {
        self.template.integrator.stability_limit()
    }

    fn controls_error(&self) -> bool {
        self.template.integrator.controls_error()
    }

    fn finds_contacts(&self) -> bool {
        true
    }
}

/// One step as a function of the states' coordinates and of the world's parameters at `places`, to the states of free bodies and of
/// contacts with bristles.
pub(crate) struct OneStep<I> {
    template: Arc<WorldTemplate<I>>,
    places: Box<[u32]>,
    step: Step,
}

impl<I: Integrator> OneStep<I> {
    /// `step` from `states` in `world`, one of the worlds of `template`, and the numbers that it is a function of.
    pub(crate) fn new<S: Scalar>(
        template: &Arc<WorldTemplate<I>>,
        world: &World<S>,
        states: &Rows<S>,
        step: Step,
    ) -> (Self, Vec<S>) {
        let ParameterDelta { places, values } = template.changes(world);
        let x = coordinates_of(states).chain(values).collect();
        (Self { template: Arc::clone(template), places, step }, x)
    }
}

/// `states` after a step of `world` whose function has the results `moved`.
pub(crate) fn with_moved<S: Scalar>(
    world: &World<S>,
    states: &Rows<S>,
    moved: &[S],
) -> Vec<BodyState<S>> {
    let mut moved = states_of(moved);
    let next = |(index, state): (usize, &BodyState<S>)| match world.moves_by_forces(index) {
        true => moved.next().unwrap_or(*state),
        false => *state,
    };
    states.iter().enumerate().map(next).collect()
}

impl<I: Integrator + Send + 'static> Recompute for OneStep<I> {
    type Error = SimulationError;

    fn evaluate<S: Scalar>(&self, x: &[S]) -> Result<Vec<S>> {
        let (states, values) = x.split_at(STATE * self.template.world.state_count());
        let world = self.template.world(&self.places, values)?;
        let state = self.template.state(states, self.step.start);
        let next = world.integrate(&self.template.integrator, &state, self.step)?;
        let moved =
            next.rows().iter().enumerate().filter(|(index, _)| world.moves_by_forces(*index));
        Ok(moved.flat_map(|(_, state)| state.coordinates()).collect())
    }
}
