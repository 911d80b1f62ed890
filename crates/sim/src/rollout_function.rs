//! A rollout as a function of rows of numbers, with its derivatives: what other languages and optimizers call.

use std::collections::HashMap;
use std::sync::Arc;

use prehend_autodiff::{Fwd, Recording, Scalar, Var};

use crate::body_state::{BodyState, STATE, coordinates_of, states_of};
use crate::error::{Result, SimulationError};
use crate::integrator::Integrator;
use crate::integrator::adaptive::Adaptive;
use crate::integrator::model_template::ModelTemplate;
use crate::model::Model;
use crate::state::State;
use crate::time::{Step, TimeSteps};

/// The states of a model at 0, dt, …, `steps`·dt as a function of the initial states, of some of its
/// [parameters](Model::parameters), and of others that a controller sets before each step.
///
/// A state is a row of 13 numbers: position x, y, z \[m\], unit quaternion i, j, k, w, velocity \[m/s\] and angular velocity \[rad/s\] of the center of
/// mass, world frame; of a link or a fixed body, of the origin of its frame. Bodies come first, then joints and contacts with bristles, as in
/// [`Model::neutral_state`]. The rows of links follow from those of joints.
///
/// Derivatives by quaternions mean something along the sphere of unit quaternions alone.
///
/// ```
/// use nalgebra::{Isometry3, Vector3};
/// use prehend_sim::{Body, RigidBody, RolloutFunction, RolloutInputs, TimeSteps, Model};
///
/// let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
/// model.add(Body::dynamic("stone", RigidBody::ball(1.0, 0.05)?));
/// let time_steps = TimeSteps { dt: 0.1, steps: 5 };
/// // By gravity, and by a push that changes from step to step.
/// let throw = RolloutFunction::new(&model, time_steps, &["gravity.z"], &["stone.force_x"])?;
/// let states = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0];
/// let inputs = RolloutInputs { states: &states, parameters: &[-9.81], controls: &[1.0; 5] };
/// let run = throw.evaluate(inputs)?;
/// let height = run[5 * 13 + 2];
///
/// let mut adjoints = vec![0.0; run.len()];
/// adjoints[5 * 13 + 2] = 1.0;
/// let gradient = throw.vjp(inputs, &run, &adjoints)?;
/// assert!((height - (3.0 * 0.5 - 0.125 * 9.81)).abs() < 1e-9);
/// assert!((gradient.parameters[0] - 0.125).abs() < 1e-9 && (gradient.states[9] - 0.5).abs() < 1e-9);
/// assert_eq!(gradient.controls, [0.0; 5]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct RolloutFunction<I = Adaptive> {
    template: Arc<ModelTemplate<I>>,
    time_steps: TimeSteps,
    /// Places of the parameters among all, then of the controls.
    places: Box<[u32]>,
    parameters: usize,
}

/// Largest deviation of a quaternion's length from 1: differences are taken about unit ones.
const UNIT: f64 = 1e-3;

/// Inputs of a [`RolloutFunction`].
#[derive(Clone, Copy, Debug)]
pub struct RolloutInputs<'a, S: Scalar = f64> {
    /// The initial states, those of bodies or all, 13 numbers each.
    pub states: &'a [S],
    /// The parameters that it was asked to vary.
    pub parameters: &'a [S],
    /// The parameters that change from step to step, those of a step after those of the step before.
    pub controls: &'a [S],
}

/// Derivatives by all [`RolloutInputs`], as many of each as were given.
#[derive(Clone, Debug, PartialEq)]
pub struct RolloutGradient {
    /// By the initial states.
    pub states: Vec<f64>,
    /// By the parameters.
    pub parameters: Vec<f64>,
    /// By the controls.
    pub controls: Vec<f64>,
}

impl RolloutFunction {
    /// Function of `model`, with [`Adaptive`] steps.
    ///
    /// # Errors
    /// See [`RolloutFunction::with_integrator`].
    pub fn new(
        model: &Model,
        time_steps: TimeSteps,
        parameters: &[&str],
        controls: &[&str],
    ) -> Result<Self> {
        Self::with_integrator(Adaptive::default(), model, time_steps, parameters, controls)
    }
}

impl<I: Integrator> RolloutFunction<I> {
    /// Function of `model` with the steps of `integrator`, by the parameters of these [names](Model::parameter_names). Those that are no inputs keep their values.
    ///
    /// # Errors
    /// If there is no such parameter or one is named twice, there is no step or its time is not positive.
    pub fn with_integrator(
        integrator: I,
        model: &Model,
        time_steps: TimeSteps,
        parameters: &[&str],
        controls: &[&str],
    ) -> Result<Self> {
        let names = model.parameter_names();
        let mut left: HashMap<&str, u32> = names.iter().map(String::as_str).zip(0..).collect();
        let mut places = Vec::with_capacity(parameters.len() + controls.len());
        for &name in parameters.iter().chain(controls) {
            let unknown = || SimulationError::NoParameter { name: name.to_owned() };
            places.push(left.remove(name).ok_or_else(unknown)?);
        }
        if !(time_steps.dt > 0.0 && time_steps.dt.is_finite()) {
            return Err(SimulationError::TimeStep(time_steps.dt));
        }
        if time_steps.steps == 0 {
            return Err(SimulationError::Inputs { what: "steps", given: 0, expected: 1 });
        }
        let template = ModelTemplate::new(integrator, model)?;
        Ok(Self { template, time_steps, places: places.into(), parameters: parameters.len() })
    }

    /// The model as it was given.
    pub fn model(&self) -> &Model {
        self.template.model_values()
    }

    /// The steps.
    pub fn time_steps(&self) -> TimeSteps {
        self.time_steps
    }

    /// Number of parameters that it takes, and of controls a step.
    pub fn inputs(&self) -> [usize; 2] {
        [self.parameters, self.places.len() - self.parameters]
    }

    /// Length of a row of all states at one time: 13 for each body, joint and contact with bristles.
    pub fn width(&self) -> usize {
        STATE * self.model().state_count()
    }

    /// The states at 0, dt, …, `steps`·dt, one after the other.
    ///
    /// # Errors
    /// As [`Model::simulate_with`], with controls as [`Model::simulate_controlled`]; if inputs are too few or too many, a quaternion has not the length 1, or there
    /// is no memory for so many steps.
    pub fn evaluate<S: Scalar>(&self, inputs: RolloutInputs<'_, S>) -> Result<Vec<S>> {
        let mut run = Vec::new();
        let numbers =
            self.time_steps.steps.checked_add(1).and_then(|n| n.checked_mul(self.width()));
        let reserved = numbers.is_some_and(|numbers| run.try_reserve_exact(numbers).is_ok());
        if !reserved {
            return Err(SimulationError::Memory { steps: self.time_steps.steps });
        }
        self.run_steps(inputs, |state| run.extend(coordinates_of(state.rows())))?;
        Ok(run)
    }

    /// The states at the end alone.
    ///
    /// # Errors
    /// See [`RolloutFunction::evaluate`].
    pub fn end<S: Scalar>(&self, inputs: RolloutInputs<'_, S>) -> Result<Vec<S>> {
        Ok(coordinates_of(self.run_steps(inputs, |_| ())?.rows()).collect())
    }

    /// The states at the end; those at the start and after each step go to `visit`.
    fn run_steps<S: Scalar>(
        &self,
        inputs: RolloutInputs<'_, S>,
        mut visit: impl FnMut(&State<S>),
    ) -> Result<State<S>> {
        self.check(&inputs)?;
        let (integrator, time_steps) = (&self.template.integrator, self.time_steps);
        let initial = self.template.state(inputs.states, 0.0);
        let model = self.template.model(&self.places, &self.values_at(&inputs, 0))?;
        let mut state = model.initialize(&initial, time_steps)?;
        visit(&state);
        let [_, controls] = self.inputs();
        if controls == 0 {
            return Ok(model.run(integrator, state, time_steps, visit)?.states);
        }
        for step in self.steps() {
            let model = self.template.model(&self.places, &self.values_at(&inputs, step.index))?;
            model.check(&state, step)?;
            state = model.advance(integrator, &state, step)?;
            visit(&state);
        }
        Ok(state)
    }

    fn steps(&self) -> impl DoubleEndedIterator<Item = Step> + use<I> {
        self.time_steps.after(0.0)
    }

    /// Parameters and controls of a step.
    fn values_at<S: Scalar>(&self, inputs: &RolloutInputs<'_, S>, step: usize) -> Vec<S> {
        let [_, count] = self.inputs();
        let controls = &inputs.controls[step * count..][..count];
        inputs.parameters.iter().chain(controls).copied().collect()
    }

    /// Checks that there are as many as it takes.
    fn check<S: Scalar>(&self, inputs: &RolloutInputs<'_, S>) -> Result<()> {
        let [parameters, controls] = self.inputs();
        let expected = [
            ("parameters", inputs.parameters.len(), parameters),
            ("controls", inputs.controls.len(), controls * self.time_steps.steps),
        ];
        for (what, given, expected) in expected {
            if given != expected {
                return Err(SimulationError::Inputs { what, given, expected });
            }
        }
        if !inputs.states.len().is_multiple_of(STATE) {
            let (given, expected) = (inputs.states.len(), self.width());
            return Err(SimulationError::Inputs { what: "numbers of states", given, expected });
        }
        // Others would scale what they turn.
        let norm =
            |row: &[S; STATE]| row[3..7].iter().map(|x| x.value().powi(2)).sum::<f64>().sqrt();
        let norms = inputs.states.as_chunks().0.iter().map(norm).enumerate();
        match norms.into_iter().find(|(_, norm)| (norm - 1.0).abs() > UNIT) {
            Some((row, norm)) => {
                let body = self.model().bodies.get(self.model().body_of_row(row).index());
                let body = body.map_or_else(String::new, |body| body.name.clone());
                Err(SimulationError::Quaternion { body, norm })
            }
            None => Ok(()),
        }
    }

    /// The product of `adjoints`, one for each number of [`RolloutFunction::evaluate`], and its Jacobian, by one sweep back through the `run` that
    /// it gave: each step is recorded again, and no more than one is held at once.
    ///
    /// The derivatives are those of [`StepCheckpointed`](crate::integrator::StepCheckpointed).
    ///
    /// # Errors
    /// See [`RolloutFunction::evaluate`]; if `run` or `adjoints` are too short or too long, the integrator's steps have no derivatives in this model, or
    /// derivatives are not finite.
    pub fn vjp(
        &self,
        inputs: RolloutInputs<'_>,
        run: &[f64],
        adjoints: &[f64],
    ) -> Result<RolloutGradient> {
        self.check(&inputs)?;
        self.template.integrator.check_differentiable(self.model())?;
        let (width, steps) = (self.width(), self.time_steps.steps);
        let expected = width * (steps + 1);
        for (what, given) in [("numbers of a run", run.len()), ("adjoints", adjoints.len())] {
            if given != expected {
                return Err(SimulationError::Inputs { what, given, expected });
            }
        }
        let (mut by_parameters, mut by_controls) =
            (vec![0.0; inputs.parameters.len()], vec![0.0; inputs.controls.len()]);
        let [_, count] = self.inputs();
        let mut add = |step: usize, by_values: &[f64]| {
            let to = by_parameters.iter_mut().chain(&mut by_controls[step * count..][..count]);
            to.zip(by_values).for_each(|(to, by)| *to += by);
        };
        let mut by_states = adjoints[steps * width..].to_vec();
        for step in self.steps().rev() {
            let before = step.index * width..(step.index + 1) * width;
            let states = &run[before.clone()];
            let [by_before, by_values] =
                self.pull_back(&inputs, step.index, states, &by_states, |model, state| {
                    model.advance(&self.template.integrator, state, step)
                })?;
            add(step.index, &by_values);
            by_states = by_before;
            by_states.iter_mut().zip(&adjoints[before]).for_each(|(by, own)| *by += own);
        }
        let begin =
            |model: &Model<Var>, state: &State<Var>| model.initialize(state, self.time_steps);
        let [states, by_values] = self.pull_back(&inputs, 0, inputs.states, &by_states, begin)?;
        add(0, &by_values);
        Ok(RolloutGradient { states, parameters: by_parameters, controls: by_controls })
    }

    /// Derivatives, by the numbers of the states `before` a step and by the parameters and controls of the step, of what `change` makes of them times
    /// `adjoints`.
    fn pull_back(
        &self,
        inputs: &RolloutInputs<'_>,
        step: usize,
        before: &[f64],
        adjoints: &[f64],
        change: impl FnOnce(&Model<Var>, &State<Var>) -> Result<State<Var>>,
    ) -> Result<[Vec<f64>; 2]> {
        let time = Step::new(step, self.time_steps.dt).start;
        let values = self.values_at(inputs, step);
        if adjoints.iter().all(|adjoint| *adjoint == 0.0) {
            return Ok([vec![0.0; before.len()], vec![0.0; values.len()]]);
        }
        let recording = Recording::start();
        let states = recording.variables_of(before);
        let values = recording.variables_of(&values);
        let model = self.template.model(&self.places, &values)?;
        let after = change(&model, &self.template.state(&states, time))?;
        let seeds = coordinates_of(after.rows()).zip(adjoints.iter().copied());
        let seeds: Vec<(Var, f64)> = seeds.filter(|(_, adjoint)| *adjoint != 0.0).collect();
        let adjoints = recording.vjp(&seeds);
        let by = |vars: &[Var]| vars.iter().map(|&var| adjoints.wrt(var)).collect::<Vec<f64>>();
        let (by_states, by_values) = (by(&states), by(&values));
        if let Some(failed) = by_states.iter().position(|slope| !slope.is_finite()) {
            let states: Vec<BodyState> = states_of(before).collect();
            return Err(self.model().not_finite_at(failed / STATE, &states, time));
        }
        match by_values.iter().all(|slope| slope.is_finite()) {
            true => Ok([by_states, by_values]),
            false => Err(model.blown_up(after.rows(), time)),
        }
    }

    /// The states of [`RolloutFunction::evaluate`] and their derivatives along `tangents` of all inputs, by forward mode.
    ///
    /// # Errors
    /// See [`RolloutFunction::evaluate`]; if tangents are too few or too many.
    pub fn jvp(
        &self,
        inputs: RolloutInputs<'_>,
        tangents: RolloutInputs<'_>,
    ) -> Result<[Vec<f64>; 2]> {
        let lift = |what: &'static str, values: &[f64], along: &[f64]| {
            let (given, expected) = (along.len(), values.len());
            if given != expected {
                return Err(SimulationError::Inputs { what, given, expected });
            }
            let pairs = values.iter().zip(along);
            Ok(pairs.map(|(&value, &along)| Fwd { value, derivative: [along] }).collect::<Vec<_>>())
        };
        let states = lift("tangents of states", inputs.states, tangents.states)?;
        let parameters = lift("tangents of parameters", inputs.parameters, tangents.parameters)?;
        let controls = lift("tangents of controls", inputs.controls, tangents.controls)?;
        let (states, parameters, controls) = (&*states, &*parameters, &*controls);
        let run: Vec<Fwd<1>> = self.evaluate(RolloutInputs { states, parameters, controls })?;
        Ok([run.iter().map(|x| x.value).collect(), run.iter().map(|x| x.derivative[0]).collect()])
    }
}
