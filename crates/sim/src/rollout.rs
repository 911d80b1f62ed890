//! Simulating for many steps.

use std::ops::ControlFlow;

use prehend_autodiff::Scalar;
use thiserror::Error;

use crate::body_state::{BodyState, Rows};
use crate::diagnostics::{Diagnostics, Resolution};
use crate::error::{Result, SimulationError};
use crate::integrator::Integrator;
use crate::integrator::adaptive::Adaptive;
use crate::model::Model;
use crate::model::bushing::Bushing;
use crate::model::contact_pair::ContactPair;
use crate::model::sample_culling::SampleCulling;
use crate::state::State;
use crate::time::{Step, TimeSteps};

/// Result of a simulation with an integrator of one's own choice.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation<T> {
    /// State at the end, or those of every step.
    pub states: T,
    /// Report on whether the steps were short enough.
    pub resolution: Resolution,
}

/// Result of a controller: nothing, whether to go on, or a result of either, whose error ends the simulation. An error is a [`SimulationError`] or
/// becomes one; that of `anyhow` does not: end such a controller with `Ok::<_, SimulationError>(())`.
pub trait ControlResult {
    /// Decision whether the simulation goes on.
    ///
    /// # Errors
    /// If the controller failed.
    fn into_flow(self) -> Result<ControlFlow<()>>;
}

impl ControlResult for () {
    fn into_flow(self) -> Result<ControlFlow<()>> {
        Ok(ControlFlow::Continue(()))
    }
}

impl ControlResult for ControlFlow<()> {
    fn into_flow(self) -> Result<ControlFlow<()>> {
        Ok(self)
    }
}

impl<C: ControlResult, E: Into<SimulationError>> ControlResult for Result<C, E> {
    fn into_flow(self) -> Result<ControlFlow<()>> {
        self.map_err(Into::into)?.into_flow()
    }
}

/// Error of a time step too long for the stiffness or damping of the contacts.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("time step {dt} s is too long for these contacts: at most {limit} s")]
pub struct StepError {
    /// The time step \[s\].
    pub dt: f64,
    /// The longest step that passes \[s\].
    pub limit: f64,
}

impl Model {
    /// Checks that `integrator` is stable with steps of `dt` \[s\] for the contacts at `state`: dt·ω ≤
    /// [`Integrator::stability_limit`] for their [`Model::contact_frequency`] ω. Impacts to come are not among them.
    ///
    /// # Errors
    /// With the longest step that passes.
    ///
    /// # Panics
    /// If it is no state of this model.
    pub fn check_time_step(
        &self,
        integrator: &impl Integrator,
        state: &State,
        dt: f64,
    ) -> Result<(), StepError> {
        let limit = integrator.stability_limit() / self.contact_frequency(state);
        if dt > 0.0 && dt <= limit { Ok(()) } else { Err(StepError { dt, limit }) }
    }
}

impl<S: Scalar> Model<S> {
    /// State `time` \[s\] later. Kinematic bodies start where their trajectory is at the time of `initial`.
    ///
    /// Steps are chosen and checked on the way, see [`Adaptive`]. Over `f64` this simulates; over
    /// [`Fwd`](prehend_autodiff::Fwd) it carries sensitivities to few inputs, over [`Var`](prehend_autodiff::Var) it records
    /// what the adjoint needs.
    ///
    /// # Errors
    /// Unless the state is one of this model and finite, and the time is positive; if the velocity of a trajectory is not the rate of
    /// its pose; where forces jump or grow so that no step is short enough, a state stops being finite or contacts make energy
    /// (see [`Model::simulate_with`]), which body, contact and time.
    pub fn simulate(&self, initial: &State<S>, time: f64) -> Result<State<S>> {
        let once = TimeSteps { dt: time, steps: 1 };
        Ok(self.simulate_with(&Adaptive::default(), initial, once)?.states)
    }

    /// States at the time of `initial` and after each step, as [`Model::simulate`] finds them.
    ///
    /// # Errors
    /// See [`Model::simulate`].
    pub fn rollout(&self, initial: &State<S>, time_steps: TimeSteps) -> Result<Vec<State<S>>> {
        Ok(self.rollout_with(&Adaptive::default(), initial, time_steps)?.states)
    }

    /// [`Model::simulate`] with the steps of `integrator`, and a report on how well they resolve the motion.
    ///
    /// Contacts that make energy are an error unless a body is kinematic, or fixed and moving: such a body may bring energy
    /// with it. Laws that drive things on purpose are for [`Model::simulate_controlled`] and [`Model::step`], which do not ask.
    ///
    /// # Errors
    /// Unless the state is one of this model and finite, and the time step is positive; if the velocity of a trajectory is not the
    /// rate of its pose; where a state stops being finite or contacts make energy, which body, contact and time; if a step's equations were not solved.
    pub fn simulate_with(
        &self,
        integrator: &impl Integrator,
        initial: &State<S>,
        time_steps: TimeSteps,
    ) -> Result<Simulation<State<S>>> {
        self.run(integrator, self.initialize(initial, time_steps)?, time_steps, |_| ())
    }

    /// [`Model::simulate_with`] of what has begun, each step of which is handed to `visit`.
    pub(crate) fn run(
        &self,
        integrator: &impl Integrator,
        mut state: State<S>,
        time_steps: TimeSteps,
        mut visit: impl FnMut(&State<S>),
    ) -> Result<Simulation<State<S>>> {
        let mut diagnostics =
            Diagnostics::new(self, state.rows(), integrator.controls_error(), true);
        let mut near = SampleCulling::new(self);
        let once = integrator.evaluates_forces_once() && self.contact_groups.is_empty();
        for step in time_steps.after(state.time) {
            let model = if once { near.model(self, state.rows(), step.dt) } else { self };
            state = model.advance(integrator, &state, step)?;
            visit(&state);
            diagnostics.step(step, state.rows())?;
        }
        let resolution = diagnostics.finish(time_steps.steps, &state)?;
        Ok(Simulation { states: state, resolution })
    }

    /// States of [`Model::simulate_with`] at the start and after each step.
    ///
    /// # Errors
    /// See [`Model::simulate_with`].
    pub fn rollout_with(
        &self,
        integrator: &impl Integrator,
        initial: &State<S>,
        time_steps: TimeSteps,
    ) -> Result<Simulation<Vec<State<S>>>> {
        let initial = self.initialize(initial, time_steps)?;
        let mut states = room_for(time_steps.steps)?;
        states.push(initial.clone());
        let keep = |next: &State<S>| states.push(next.clone());
        let resolution = self.run(integrator, initial, time_steps, keep)?.resolution;
        Ok(Simulation { states, resolution })
    }

    /// [`Model::simulate_with`] under `control`, which is called before each step: it sees the state and may set external
    /// wrenches, gravity, parameters of laws, of contacts and [along joints](Model::joint_force_mut), and the states of fixed bodies, for
    /// that step and those after it. It may return nothing; [`ControlFlow`], which ends the simulation before that step; or a result of
    /// either, whose error ends it, too.
    ///
    /// In the report, what the controller changes from one step to the next counts as roughness.
    ///
    /// Over a scalar that carries derivatives they pass through the controller too.
    ///
    /// ```
    /// # use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
    /// # use prehend_autodiff::Fwd;
    /// # use prehend_sim::prelude::*;
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let mut model = Model::new(Vector3::zeros());
    /// # let rigid = RigidBody::new(0.2, Matrix3::identity() * 1e-4, Point3::origin())?;
    /// # let ball = model.add(Body::dynamic("ball", rigid));
    /// # let mut start = model.neutral_state();
    /// # start[ball].pose.translation.x = 1.0;
    /// // A spring of 2 N/m pulls the ball back; how far, by its stiffness?
    /// let stiffness = Fwd::<1>::variable(2.0, 0);
    /// let time_steps = TimeSteps { dt: 1e-2, steps: 30 };
    /// let control = |_, model: &mut Model<_>, state: &mut State<_>| {
    ///     model.bodies[ball].external_wrench.x = -stiffness * state[ball].pose.translation.x;
    /// };
    /// let (lifted, start) = (model.cast(), start.cast());
    /// let run = lifted.simulate_controlled(&Adaptive::default(), &start, time_steps, control)?;
    /// let end = run.states;
    /// assert!(end[ball].pose.translation.x.derivative[0] < 0.0);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`Model::simulate_with`], but for energy, which a controller may bring.
    pub fn simulate_controlled<R: ControlResult>(
        &self,
        integrator: &impl Integrator,
        initial: &State<S>,
        time_steps: TimeSteps,
        control: impl FnMut(Step, &mut Self, &mut State<S>) -> R,
    ) -> Result<Simulation<State<S>>> {
        self.controlled(integrator, initial, time_steps, control, |_| ())
    }

    /// States of [`Model::simulate_controlled`] at the start and after each step, or until `control` ends it.
    ///
    /// # Errors
    /// See there.
    pub fn rollout_controlled<R: ControlResult>(
        &self,
        integrator: &impl Integrator,
        initial: &State<S>,
        time_steps: TimeSteps,
        control: impl FnMut(Step, &mut Self, &mut State<S>) -> R,
    ) -> Result<Simulation<Vec<State<S>>>> {
        let mut states = room_for(time_steps.steps)?;
        let keep = |state: &State<S>| states.push(state.clone());
        let end = self.controlled(integrator, initial, time_steps, control, keep)?;
        states.push(end.states);
        Ok(Simulation { states, resolution: end.resolution })
    }

    fn controlled<R: ControlResult>(
        &self,
        integrator: &impl Integrator,
        initial: &State<S>,
        time_steps: TimeSteps,
        mut control: impl FnMut(Step, &mut Self, &mut State<S>) -> R,
        mut visit: impl FnMut(&State<S>),
    ) -> Result<Simulation<State<S>>> {
        let (mut state, mut model) = (self.initialize(initial, time_steps)?, self.clone());
        let mut diagnostics =
            Diagnostics::new(self, state.rows(), integrator.controls_error(), false);
        let mut steps = 0;
        for step in time_steps.after(state.time) {
            if control(step, &mut model, &mut state).into_flow()?.is_break() {
                break;
            }
            state.time = step.start;
            visit(&state);
            model.check(&state, step)?;
            state = model.advance(integrator, &state, step)?;
            diagnostics.step(step, state.rows())?;
            steps += 1;
        }
        let resolution = diagnostics.finish(steps, &state)?;
        Ok(Simulation { states: state, resolution })
    }

    /// State at the end of a step: the integrator's, then that of kinematic bodies. The step says when it begins, whatever `state.time` is.
    ///
    /// # Errors
    /// As [`Model::simulate_with`], but for energy, which takes more than a step to tell.
    pub fn step(
        &self,
        integrator: &impl Integrator,
        state: &State<S>,
        step: Step,
    ) -> Result<State<S>> {
        let mut state = self.with_deflections(state.clone());
        state.time = step.start;
        self.check(&state, step)?;
        self.forward_kinematics(state.rows_mut());
        self.advance(integrator, &state, step)
    }

    /// [`Model::step`] of what has been checked.
    pub(crate) fn advance(
        &self,
        integrator: &impl Integrator,
        state: &State<S>,
        step: Step,
    ) -> Result<State<S>> {
        let mut next = self.integrate(integrator, state, step)?;
        next.time = step.end();
        self.finish_step(state.rows(), next.rows_mut(), step.end())?;
        Ok(next)
    }

    /// Puts kinematic bodies and links among the rows `next` where they are at `time` \[s\], after a step from `rows`.
    ///
    /// # Errors
    /// If one is not finite.
    pub(crate) fn finish_step(&self, rows: &Rows<S>, next: &mut Rows<S>, time: f64) -> Result<()> {
        self.place_bodies(next, time);
        match next.iter().all(BodyState::is_finite) {
            true => Ok(()),
            false => Err(self.not_finite(rows, next, time)),
        }
    }

    /// The integrator's step, among the contacts of groups that may touch within it.
    pub(crate) fn integrate(
        &self,
        integrator: &impl Integrator,
        state: &State<S>,
        step: Step,
    ) -> Result<State<S>> {
        if self.contact_groups.is_empty() || integrator.finds_contacts() {
            return integrator.step(self, state, step);
        }
        let near = self.with_candidates(state.rows(), step);
        integrator.step(&near, state, step)
    }

    /// State from which a rollout begins: `initial` with kinematic bodies where their trajectories are at its time.
    ///
    /// # Errors
    /// See [`Model::check`] and [`Model::check_velocities`].
    pub(crate) fn initialize(&self, initial: &State<S>, time_steps: TimeSteps) -> Result<State<S>> {
        let mut state = self.with_deflections(initial.clone());
        let first = Step { index: 0, start: initial.time, dt: time_steps.dt };
        self.check(&state, first)?;
        self.check_velocities([initial.time, time_steps.end(initial.time)])?;
        self.place_bodies(state.rows_mut(), initial.time);
        Ok(state)
    }

    /// Checks that a rollout may begin.
    pub(crate) fn check(&self, state: &State<S>, step: Step) -> Result<()> {
        let Step { start, dt, .. } = step;
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(SimulationError::TimeStep(dt));
        }
        if !start.is_finite() {
            return Err(SimulationError::Time(start));
        }
        self.check_count(state)?;
        self.contact_materials().try_for_each(ContactPair::check)?;
        self.joint_forces.iter().try_for_each(|force| self.check_joint_force(force))?;
        self.bushings.iter().try_for_each(Bushing::check)?;
        match state.rows().iter().all(BodyState::is_finite) {
            true => Ok(()),
            false => Err(self.not_finite(state.rows(), state.rows(), start)),
        }
    }
}

/// An empty list with room for what is at the start and after each of `steps`.
fn room_for<T>(steps: usize) -> Result<Vec<T>> {
    let mut list = Vec::new();
    match steps.checked_add(1).map(|count| list.try_reserve_exact(count)) {
        Some(Ok(())) => Ok(list),
        _ => Err(SimulationError::Memory { steps }),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Isometry3, Vector3};
    use prehend_autodiff::Fwd;

    use super::*;
    use crate::contact::{LawError, LawRegistry};
    use crate::scenes::{bowl, egg_on};
    use crate::{GapSmoothing, Motion, SemiImplicitEuler};

    #[test]
    fn parameters_out_of_range_and_missing_states_are_refused() {
        let (mut model, states) = egg_on(bowl(), GapSmoothing::Hard);
        let step = |model: &Model, states: &State, dt| {
            model.step(&SemiImplicitEuler, states, Step::new(0, dt)).map(|_| ()).unwrap_err()
        };
        assert_eq!(
            step(&model, &State::new(&states.bodies()[..1]), 1e-3),
            SimulationError::States { states: 1, bodies: 2, joints: 0, bristles: 0 }
        );
        assert_eq!(step(&model, &states, -1.0), SimulationError::TimeStep(-1.0));
        for (bad, message) in [
            ([-1e7, 2e4, 0.6], "stiffness must be positive, is -10000000"),
            ([1e7, 2e4, -0.1], "friction must be zero or positive, is -0.1"),
            ([1e7, f64::NAN, 0.6], "parameter of a contact must be finite, is NaN"),
        ] {
            model.contacts[0].set_params(&bad).unwrap();
            assert_eq!(step(&model, &states, 1e-3).to_string(), message);
        }
        let error = model.contacts[0].set_params(&[1e7]).unwrap_err();
        assert_eq!(error, LawError::Count { given: 1, expected: 3 });
    }

    #[test]
    fn parameters_of_friction_out_of_range_are_refused_after_lifting_and_with_parameters() {
        let registry = LawRegistry::default();
        for (name, values, parts) in [
            ("penalty_grain", &[5e6, 2e4, 0.6, 0.5, 1e-2, 1.0, 0.0, 0.0][..], 2),
            ("penalty_stribeck", &[5e6, 2e4, 0.6, 0.3, 0.05, 1e-2], 3),
        ] {
            let (mut model, states) = egg_on(bowl(), GapSmoothing::Hard);
            model.contacts[0].set_law(registry.create(name, values).unwrap().into());
            let (step, good) = (Step::new(0, 1e-3), model.parameters());
            for (k, parameter) in
                registry.entry(name).unwrap().parameters[2..][..parts].iter().enumerate()
            {
                let mut bad = good.clone();
                bad[good.len() - parts + k] = -1.0;
                let changed = model.with_parameters(&bad).unwrap();
                let refused = changed.step(&SemiImplicitEuler, &states, step).unwrap_err();
                assert!(
                    matches!(&refused, SimulationError::Law(e) if e.name() == Some(parameter.name))
                );
                let mut lifted = model.cast::<Fwd<1>>();
                lifted.contacts[0].params_mut()[2 + k] = Fwd::constant(-1.0);
                let states = states.cast();
                assert_eq!(lifted.step(&SemiImplicitEuler, &states, step).unwrap_err(), refused);
            }
        }
    }

    #[test]
    fn driven_bodies_start_on_their_trajectory() {
        let (mut model, states) = egg_on(bowl(), GapSmoothing::Hard);
        let rising = |time: f64| BodyState {
            linear: Vector3::z(),
            ..BodyState::at_rest(Isometry3::translation(0.0, 0.0, time - 0.3))
        };
        model.bodies[0].motion = Motion::Kinematic(Arc::new(rising));
        let run = model
            .rollout_with(&SemiImplicitEuler, &states, TimeSteps { dt: 0.1, steps: 2 })
            .unwrap()
            .states;
        let heights = [0, 1, 2].map(|i: usize| run[i][0].pose.translation.z);
        assert!((heights[0] + 0.3).abs() < 1e-15 && (heights[2] + 0.1).abs() < 1e-15);
    }

    #[test]
    fn a_controller_ends_a_simulation() {
        let (model, states) = egg_on(bowl(), GapSmoothing::Hard);
        let time_steps = TimeSteps { dt: 1e-3, steps: 100 };
        let control = |step: Step, _: &mut Model, states: &mut State| {
            states[1].linear.x = 0.1;
            match step.index {
                7 => ControlFlow::Break(()),
                _ => ControlFlow::Continue(()),
            }
        };
        let run = model.rollout_controlled(&SemiImplicitEuler, &states, time_steps, control);
        let run = run.unwrap();
        assert_eq!((run.states.len(), run.resolution.steps), (8, 7));
        let end = model.simulate_controlled(&SemiImplicitEuler, &states, time_steps, control);
        assert_eq!(&end.unwrap().states, run.states.last().unwrap());
        let fails = |step: Step, _: &mut Model, _: &mut State| match step.index {
            3 => Err(SimulationError::TimeStep(0.0)),
            _ => Ok(ControlFlow::Continue(())),
        };
        let failed = model.simulate_controlled(&SemiImplicitEuler, &states, time_steps, fails);
        assert_eq!(failed, Err(SimulationError::TimeStep(0.0)));
    }

    #[test]
    fn bad_starts_and_blow_ups_say_where() {
        let (model, states) = egg_on(bowl(), GapSmoothing::Hard);
        let roll = |states: &State, dt| {
            model.rollout_with(&SemiImplicitEuler, states, TimeSteps { dt, steps: 2000 })
        };
        assert_eq!(roll(&states, 0.0).unwrap_err(), SimulationError::TimeStep(0.0));
        let error = roll(&State::new(&states.bodies()[..1]), 1e-3).unwrap_err();
        assert_eq!(error, SimulationError::States { states: 1, bodies: 2, joints: 0, bristles: 0 });
        let mut lost = states.clone();
        lost[1].linear = Vector3::repeat(f64::NAN);
        let error = roll(&lost, 1e-3).unwrap_err();
        assert_eq!(
            error,
            SimulationError::NotFinite {
                body: "egg".to_owned(),
                contact: Some("ground".to_owned()),
                time: 0.0
            }
        );
        let mut wild = states.clone();
        wild[1].linear = Vector3::repeat(1e308);
        assert!(
            matches!(roll(&wild, 1.0), Err(SimulationError::NotFinite { time, .. }) if time > 0.5)
        );
    }
}
