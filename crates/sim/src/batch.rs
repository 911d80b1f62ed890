//! Many models at once.

use std::sync::Arc;

use prehend_autodiff::{Recompute, Scalar};

use crate::body_state::{STATE, coordinates_of};
use crate::error::{Result, SimulationError};
use crate::integrator::Integrator;
use crate::integrator::adaptive::Adaptive;
use crate::integrator::model_template::{ModelTemplate, ParameterDelta};
use crate::integrator::step_checkpointed::StepCheckpointed;
use crate::model::Model;
use crate::state::State;
use crate::time::TimeSteps;

/// Simulates models that share bodies, shapes and laws and differ in numbers and states, side by side on the threads of `rayon`.
///
/// Any scalar goes: plain numbers simulate, [`Fwd`](prehend_autodiff::Fwd) carries sensitivities, and with
/// [`Var`](prehend_autodiff::Var) all runs are one node, which keeps the numbers that each run began with. The sweep simulates
/// each again, side by side as well; runs on which the loss does not depend are left out. Results and derivatives are the same, to
/// the last bit, for any number of threads.
///
/// Many short runs with friction take a tenth of the time with [`SemiImplicitEuler`](crate::SemiImplicitEuler) and [`Coulomb`](crate::Coulomb) of what they
/// take with the default steps and a [`Material`](crate::Material), whose friction holds.
///
/// Whatever [`Model::parameters`] lists may differ, and may carry derivatives; so may states.
///
/// ```
/// use nalgebra::Vector3;
/// use prehend_autodiff::{Recording, Scalar};
/// use prehend_sim::{Batch, Body, RigidBody, SimulationError, TimeSteps, Model};
///
/// let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
/// let id = model.add(Body::dynamic("stone", RigidBody::ball(1.0, 0.05)?));
/// let batch = Batch::new(&model)?;
///
/// // By how much does the mean height of 100 throws change with gravity?
/// let recording = Recording::start();
/// let gravity = recording.variable(-9.81);
/// let throws = (0..100).map(|i| {
///     let mut lifted = model.cast();
///     lifted.gravity.z = gravity;
///     let mut start = lifted.neutral_state();
///     start[id].linear.z = Scalar::constant(0.1 * f64::from(i));
///     (lifted, start)
/// });
/// let ends = batch.simulate(throws, TimeSteps { dt: 0.5, steps: 1 });
/// let ends = ends.into_iter().collect::<Result<Vec<_>, SimulationError>>()?;
/// let heights = ends.iter().map(|end| end[id].pose.translation.z);
/// let mean = heights.reduce(|sum, height| sum + height).unwrap_or_default().times(0.01);
/// let slope = recording.gradient(mean).wrt(gravity);
/// assert!((slope - 0.125).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Batch<I = Adaptive> {
    template: Arc<ModelTemplate<I>>,
}

impl Batch {
    /// Batch of models like `model`, with [`Adaptive`] steps.
    ///
    /// # Errors
    /// See [`Batch::with_integrator`].
    pub fn new<S: Scalar>(model: &Model<S>) -> Result<Self> {
        Self::with_integrator(Adaptive::default(), model)
    }
}

impl<I: Integrator + Send + 'static> Batch<I> {
    /// Batch of models like `model`, with the steps of `integrator`.
    ///
    /// # Errors
    /// If a body of the model has an impossible mass, inertia or center of mass, or a trajectory carries derivatives.
    pub fn with_integrator<S: Scalar>(integrator: I, model: &Model<S>) -> Result<Self> {
        Ok(Self { template: ModelTemplate::new(integrator, model)? })
    }

    /// State of each of `variants`, a model and the state that it starts from, after `time_steps`, as
    /// [`Model::simulate_with`] finds it.
    ///
    /// Variants are taken one after the other, and only what they change is kept.
    ///
    /// # Errors
    /// Each for itself: those of [`Model::simulate_with`]; if the model differs from that of the batch in more than parameters, or a
    /// trajectory carries derivatives.
    pub fn simulate<S: Scalar>(
        &self,
        variants: impl IntoIterator<Item = (Model<S>, State<S>)>,
        time_steps: TimeSteps,
    ) -> Vec<Result<State<S>>> {
        let mut refused = Vec::new();
        let mut runs = Vec::new();
        for (index, (model, state)) in variants.into_iter().enumerate() {
            match self.run(&model, &state, time_steps) {
                Ok(run) => runs.push(run),
                Err(error) => refused.push((index, error)),
            }
        }
        let times: Vec<f64> = runs.iter().map(|(run, _)| time_steps.end(run.start)).collect();
        let ends = S::recompute_each(runs).into_iter().zip(times);
        let ends = ends.map(|(end, time)| Ok(self.template.state(&end?, time)));
        let mut ends: Vec<Result<State<S>>> = ends.collect();
        for (index, error) in refused {
            ends.insert(index, Err(error));
        }
        ends
    }

    /// A run and the numbers that it starts with.
    fn run<S: Scalar>(
        &self,
        model: &Model<S>,
        state: &State<S>,
        time_steps: TimeSteps,
    ) -> Result<(BatchRun<I>, Vec<S>)> {
        model.check_trajectories()?;
        if !self.template.is_of(model) {
            return Err(SimulationError::AnotherModel);
        }
        if S::ORDER > 0 {
            self.template.integrator.check_differentiable(model)?;
        }
        let ParameterDelta { places, values } = self.template.changes(model);
        let numbers = coordinates_of(state.rows()).chain(values).collect();
        let run = BatchRun {
            template: Arc::clone(&self.template),
            places,
            rows: state.rows().len(),
            start: state.time,
            time_steps,
        };
        Ok((run, numbers))
    }
}

/// Steps of a body that one model records at once at most: some 10 kB each.
const FEW: usize = 2000;

/// A simulation as a function of the states' coordinates and of the model's parameters at `places`, to the states at its end.
struct BatchRun<I> {
    template: Arc<ModelTemplate<I>>,
    places: Box<[u32]>,
    /// Number of rows that it starts from.
    rows: usize,
    /// Time at its start \[s\].
    start: f64,
    time_steps: TimeSteps,
}

impl<I: Integrator + Send + 'static> Recompute for BatchRun<I> {
    type Error = SimulationError;

    fn evaluate<S: Scalar>(&self, x: &[S]) -> Result<Vec<S>> {
        let (states, values) = x.split_at(STATE * self.rows);
        let model = self.template.model(&self.places, values)?;
        let state = self.template.state(states, self.start);
        // Few steps are recorded as they are, of many one at a time.
        let TimeSteps { steps, .. } = self.time_steps;
        let few = steps == 1
            || steps.saturating_mul(self.rows) <= FEW && !self.template.integrator.controls_error();
        let end = match S::RECORDED && !few {
            true => {
                let steps = StepCheckpointed::of(&self.template);
                model.simulate_with(&steps, &state, self.time_steps)
            }
            false => {
                let integrator = &self.template.integrator;
                model.simulate_with(integrator, &state, self.time_steps)
            }
        };
        Ok(coordinates_of(end?.states.rows()).collect())
    }
}
