//! Reverse mode through rollouts: one node a step.

use std::sync::Arc;

#[cfg(doc)]
use prehend_autodiff::Var;
use prehend_autodiff::{Recompute, Scalar};

use super::Integrator;
use super::model_template::{ModelTemplate, ParameterDelta};
use crate::body_state::{BodyState, Rows, STATE, coordinates_of, states_of};
use crate::error::{Result, SimulationError};
use crate::model::Model;
use crate::state::State;
use crate::time::Step;

/// An integrator each of whose steps [`Var`] records as one node.
///
/// The node keeps the numbers that the step began with, and the sweep records the step again: some 540 bytes for a free
/// body on a fixed one, 1330 if every parameter of their model varies, where plain recording takes 10 kB. States, masses, centers
/// of mass, external wrenches, gravity and parameters of laws may come from anywhere on the tape and may be others at each step.
/// Numbers without derivatives are simulated by `integrator` as it is.
///
/// ```
/// # use std::sync::Arc;
/// # use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
/// # use prehend_autodiff::{Recording, Var};
/// # use prehend_sim::prelude::*;
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
/// # let rigid = RigidBody::new(0.2, Matrix3::identity() * 1e-4, Point3::origin())?;
/// # let ball = model.add(Body::dynamic("ball", rigid));
/// let recording = Recording::start();
/// let mut lifted = model.cast::<Var>();
/// lifted.gravity.z = recording.variable(-9.81);
/// let start = model.neutral_state().cast();
/// let integrator = StepCheckpointed::new(SemiImplicitEuler, &model)?;
/// let end = lifted.simulate_with(&integrator, &start, TimeSteps { dt: 1e-3, steps: 1000 })?.states;
/// let by_gravity = recording.gradient(end[ball].linear.z).wrt(lifted.gravity.z);
/// assert!((by_gravity - 1.0).abs() < 1e-12);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct StepCheckpointed<I> {
    template: Arc<ModelTemplate<I>>,
}

impl<I: Integrator> StepCheckpointed<I> {
    /// `integrator` for `model` and others that differ from it in parameters only.
    ///
    /// # Errors
    /// If a body of the model has an impossible mass, inertia or center of mass, or a trajectory carries derivatives.
    pub fn new<S: Scalar>(integrator: I, model: &Model<S>) -> Result<Self> {
        Ok(Self { template: ModelTemplate::new(integrator, model)? })
    }

    /// Steps of a model of `template`.
    pub(crate) fn of(template: &Arc<ModelTemplate<I>>) -> Self {
        Self { template: Arc::clone(template) }
    }
}

impl<I: Integrator + Send + 'static> Integrator for StepCheckpointed<I> {
    /// # Errors
    /// As the integrator within; if the model differs from the one of [`StepCheckpointed::new`] in more than parameters, or a
    /// trajectory carries derivatives.
    fn step<S: Scalar>(&self, model: &Model<S>, state: &State<S>, step: Step) -> Result<State<S>> {
        if S::ORDER == 0 {
            return model.integrate(&self.template.integrator, state, step);
        }
        model.check_trajectories()?;
        if !self.template.is_of(model) {
            return Err(SimulationError::AnotherModel);
        }
        self.check_differentiable(model)?;
        let (function, x) = OneStep::new(&self.template, model, state.rows(), step);
        let after = S::recompute(function, &x)?;
        Ok(state.with(with_moved(model, state.rows(), &after), step.end()))
    }

    fn check_differentiable<S: Scalar>(&self, model: &Model<S>) -> Result<()> {
        self.template.integrator.check_differentiable(model)
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

/// One step as a function of the states' coordinates and of the model's parameters at `places`, to the states of free bodies and of
/// contacts with bristles.
pub(crate) struct OneStep<I> {
    template: Arc<ModelTemplate<I>>,
    places: Box<[u32]>,
    step: Step,
}

impl<I: Integrator> OneStep<I> {
    /// `step` from `states` in `model`, one of the models of `template`, and the numbers that it is a function of.
    pub(crate) fn new<S: Scalar>(
        template: &Arc<ModelTemplate<I>>,
        model: &Model<S>,
        states: &Rows<S>,
        step: Step,
    ) -> (Self, Vec<S>) {
        let ParameterDelta { places, values } = template.changes(model);
        let x = coordinates_of(states).chain(values).collect();
        (Self { template: Arc::clone(template), places, step }, x)
    }
}

/// `states` after a step of `model` whose function has the results `moved`.
pub(crate) fn with_moved<S: Scalar>(
    model: &Model<S>,
    states: &Rows<S>,
    moved: &[S],
) -> Vec<BodyState<S>> {
    let mut moved = states_of(moved);
    let next = |(index, state): (usize, &BodyState<S>)| match model.moves_by_forces(index) {
        true => moved.next().unwrap_or(*state),
        false => *state,
    };
    states.iter().enumerate().map(next).collect()
}

impl<I: Integrator + Send + 'static> Recompute for OneStep<I> {
    type Error = SimulationError;

    fn evaluate<S: Scalar>(&self, x: &[S]) -> Result<Vec<S>> {
        let (states, values) = x.split_at(STATE * self.template.model.state_count());
        let model = self.template.model(&self.places, values)?;
        let state = self.template.state(states, self.step.start);
        let next = model.integrate(&self.template.integrator, &state, self.step)?;
        let moved =
            next.rows().iter().enumerate().filter(|(index, _)| model.moves_by_forces(*index));
        Ok(moved.flat_map(|(_, state)| state.coordinates()).collect())
    }
}
