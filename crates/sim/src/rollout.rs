//! Simulating for many steps.

use prehend_autodiff::Scalar;

use crate::error::SimulationError;
use crate::integrator::Integrator;
use crate::near::Near;
use crate::state::State;
use crate::world::{Step, World};

/// How long and how finely a rollout is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Horizon {
    /// Time step \[s\].
    pub dt: f64,
    /// Number of steps.
    pub steps: usize,
}

impl<S: Scalar> World<S> {
    /// The states of all bodies at 0, dt, …, `steps`·dt, from `initial`; driven bodies start where their course does.
    ///
    /// Over `f64` this simulates; over [`Fwd`](prehend_autodiff::Fwd) it carries sensitivities to few inputs, over
    /// [`Var`](prehend_autodiff::Var) it records what the adjoint needs.
    ///
    /// # Errors
    /// Unless there is one finite state for each body and the time step is positive; where a state stops being finite,
    /// which one and when; if a step's equations were not solved.
    pub fn rollout(
        &self,
        integrator: &impl Integrator,
        initial: &[State<S>],
        horizon: Horizon,
    ) -> Result<Vec<Vec<State<S>>>, SimulationError> {
        let mut states = Vec::with_capacity(horizon.steps + 1);
        states.push(self.started(initial));
        self.simulate(integrator, initial, horizon, |_, next| states.push(next.to_vec()))?;
        Ok(states)
    }

    /// [`World::rollout`] that hands each step's states to `visit` instead of keeping them, and returns the last.
    ///
    /// # Errors
    /// See [`World::rollout`].
    pub fn simulate(
        &self,
        integrator: &impl Integrator,
        initial: &[State<S>],
        Horizon { dt, steps }: Horizon,
        mut visit: impl FnMut(Step, &[State<S>]),
    ) -> Result<Vec<State<S>>, SimulationError> {
        self.check(initial, dt)?;
        let mut states = self.started(initial);
        let mut near = Near::new(self);
        for index in 0..steps {
            let step = Step { index, dt };
            let known = integrator.needs_forces_at_start_only();
            let world = if known { near.world(self, &states, dt) } else { self };
            states = world.advance(integrator, &states, step)?;
            visit(step, &states);
        }
        Ok(states)
    }

    /// One step: the integrator's, then that of driven bodies.
    ///
    /// # Errors
    /// As [`World::rollout`].
    pub fn step(
        &self,
        integrator: &impl Integrator,
        states: &[State<S>],
        step: Step,
    ) -> Result<Vec<State<S>>, SimulationError> {
        self.check(states, step.dt)?;
        self.advance(integrator, states, step)
    }

    /// [`World::step`] of what has been checked.
    pub(crate) fn advance(
        &self,
        integrator: &impl Integrator,
        states: &[State<S>],
        step: Step,
    ) -> Result<Vec<State<S>>, SimulationError> {
        let mut next = integrator.step(self, states, step)?;
        let after = step.after();
        self.drive(&mut next, after.time());
        self.check_finite(&next, after)?;
        Ok(next)
    }

    /// The states with driven bodies where their courses start.
    pub(crate) fn started(&self, initial: &[State<S>]) -> Vec<State<S>> {
        let mut states = initial.to_vec();
        self.drive(&mut states, 0.0);
        states
    }

    /// Whether a rollout may begin.
    pub(crate) fn check(&self, states: &[State<S>], dt: f64) -> Result<(), SimulationError> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(SimulationError::TimeStep(dt));
        }
        let bodies = self.bodies.len();
        if states.len() != bodies {
            return Err(SimulationError::States { states: states.len(), bodies });
        }
        for pair in &self.contacts {
            pair.check()?;
        }
        self.check_finite(states, Step { index: 0, dt })
    }

    fn check_finite(&self, states: &[State<S>], step: Step) -> Result<(), SimulationError> {
        match states.iter().position(|state| !state.is_finite()) {
            Some(body) => Err(SimulationError::NotFinite {
                body: self.bodies[body].name.clone(),
                step: step.index,
                time: step.time(),
            }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector3};

    use super::*;
    use crate::scenes::{bowl, egg_on};
    use crate::{Onset, SemiImplicitEuler};
    use prehend_autodiff::check::{compare_gradients, finite_difference_jacobian};
    use prehend_autodiff::lie::so3_log;

    #[test]
    fn sensitivities_match_differences_on_smooth_fields() {
        let (world, states) = egg_on(bowl(), Onset::Softplus { width: 3e-4 });
        let horizon = Horizon { dt: 1e-3, steps: 30 };
        let mut lifted: Vec<State<_>> = states.iter().map(|s| s.lift()).collect();
        lifted[1] = states[1].variables();
        let run = world.lift().rollout(&SemiImplicitEuler, &lifted, horizon).unwrap();
        let end = run.last().unwrap()[1];
        let state = end.value();
        assert!((state.linear - (states[1].linear + world.gravity * 0.03)).norm() > 0.05);
        let differences = finite_difference_jacobian(
            |x| {
                let mut moved = states.clone();
                moved[1] = states[1].moved(&std::array::from_fn::<f64, 12, _>(|i| x[i]));
                let run = world.rollout(&SemiImplicitEuler, &moved, horizon).unwrap();
                let end = run.last().unwrap()[1];
                let turn = so3_log(&(end.pose.rotation * state.pose.rotation.inverse()));
                let parts = [end.pose.translation.vector, turn, end.linear, end.angular];
                parts.iter().flat_map(|v| v.iter().copied()).collect()
            },
            &[0.0; 12],
            2e-6,
        );
        for (row, reference) in differences.iter().enumerate() {
            let exact: Vec<f64> = end.sensitivity().row(row).iter().copied().collect();
            let error = compare_gradients(&exact, reference);
            assert!(error.relative < 1e-6, "row {row}: {error:?}");
        }
    }

    #[test]
    fn parameters_out_of_range_and_missing_states_are_refused() {
        let (mut world, states) = egg_on(bowl(), Onset::Hard);
        let step = |world: &World, states: &[State], dt| {
            world.step(&SemiImplicitEuler, states, Step { index: 0, dt }).map(|_| ()).unwrap_err()
        };
        assert_eq!(
            step(&world, &states[..1], 1e-3),
            SimulationError::States { states: 1, bodies: 2 }
        );
        assert_eq!(step(&world, &states, -1.0), SimulationError::TimeStep(-1.0));
        for (bad, message) in [
            (vec![-1e7, 2e4, 0.6], "stiffness must be positive, is -10000000"),
            (vec![1e7, f64::NAN, 0.6], "parameter of a contact must be finite, is NaN"),
            (vec![1e7], "number of parameters must be the law's, is 1"),
        ] {
            world.contacts[0].params = bad;
            assert_eq!(step(&world, &states, 1e-3).to_string(), message);
        }
    }

    #[test]
    fn driven_bodies_start_on_their_course() {
        let (mut world, states) = egg_on(bowl(), Onset::Hard);
        let course = |time: f64| State::at_rest(Isometry3::translation(0.0, 0.0, time - 0.3));
        world.bodies[0].motion = crate::Motion::Driven(std::sync::Arc::new(course));
        let run =
            world.rollout(&SemiImplicitEuler, &states, Horizon { dt: 0.1, steps: 2 }).unwrap();
        let heights = [0, 1, 2].map(|i: usize| run[i][0].pose.translation.z);
        assert!((heights[0] + 0.3).abs() < 1e-15 && (heights[2] + 0.1).abs() < 1e-15);
    }

    #[test]
    fn bad_starts_and_blow_ups_say_where() {
        let (world, states) = egg_on(bowl(), Onset::Hard);
        let roll = |states: &[State], dt| {
            world.rollout(&SemiImplicitEuler, states, Horizon { dt, steps: 2000 })
        };
        assert_eq!(roll(&states, 0.0).unwrap_err(), SimulationError::TimeStep(0.0));
        let error = roll(&states[..1], 1e-3).unwrap_err();
        assert_eq!(error, SimulationError::States { states: 1, bodies: 2 });
        let mut lost = states.clone();
        lost[1].linear = Vector3::repeat(f64::NAN);
        let error = roll(&lost, 1e-3).unwrap_err();
        assert_eq!(
            error,
            SimulationError::NotFinite { body: "egg".to_owned(), step: 0, time: 0.0 }
        );
        let mut wild = states.clone();
        wild[1].linear = Vector3::repeat(1e308);
        assert!(matches!(roll(&wild, 1.0), Err(SimulationError::NotFinite { step: 1.., .. })));
    }
}
