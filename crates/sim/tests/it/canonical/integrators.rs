//! The integrators under test and what theory says of them.

use std::f64::consts::SQRT_2;

use prehend_autodiff::Fwd;
use prehend_sim::{
    BodyState, Integrator, Model, RungeKutta4, SemiImplicitEuler, SimulationError, State,
    TimeSteps, integrator::BackwardEuler,
};

/// An integrator.
pub(crate) struct Scheme {
    pub(crate) name: &'static str,
    pub(crate) method: &'static dyn Method,
    /// Undamped contact is stable for dt·ω below this, or for any step.
    pub(crate) stable_below: Option<f64>,
    /// a in the height after n steps of free fall, −g dt² n(n + a)/2.
    pub(crate) fall_lead: f64,
    /// Whether an elastic bounce that takes twenty steps keeps its energy.
    pub(crate) keeps_energy: bool,
    /// Whether angular momentum is kept to rounding.
    pub(crate) keeps_angular_momentum: bool,
}

/// Every integrator.
pub(crate) const SCHEMES: &[Scheme] = &[
    Scheme {
        name: "semi-implicit Euler",
        method: &SemiImplicitEuler,
        stable_below: Some(2.0),
        fall_lead: 1.0,
        keeps_energy: true,
        keeps_angular_momentum: true,
    },
    Scheme {
        name: "Runge–Kutta 4",
        method: &RungeKutta4,
        stable_below: Some(2.0 * SQRT_2),
        fall_lead: 0.0,
        keeps_energy: true,
        keeps_angular_momentum: false,
    },
    Scheme {
        name: "backward Euler",
        method: &BackwardEuler,
        stable_below: None,
        fall_lead: 1.0,
        keeps_energy: false,
        keeps_angular_momentum: false,
    },
];

/// The number of inputs that forward mode differentiates by.
pub(crate) const INPUTS: usize = 4;

/// [`Integrator`] over the scalars of this suite, as an object.
pub(crate) trait Method: Sync {
    fn rollout(
        &self,
        model: &Model,
        start: &State,
        time_steps: TimeSteps,
    ) -> Result<Vec<State>, SimulationError>;

    fn differentiate(
        &self,
        model: &Model,
        start: &State<Fwd<INPUTS>>,
        time_steps: TimeSteps,
    ) -> Result<State<Fwd<INPUTS>>, SimulationError>;
}

impl<I: Integrator> Method for I {
    fn rollout(
        &self,
        model: &Model,
        start: &State,
        time_steps: TimeSteps,
    ) -> Result<Vec<State>, SimulationError> {
        model.rollout_with(self, start, time_steps).map(|run| run.states)
    }

    fn differentiate(
        &self,
        model: &Model,
        start: &State<Fwd<INPUTS>>,
        time_steps: TimeSteps,
    ) -> Result<State<Fwd<INPUTS>>, SimulationError> {
        model.cast().simulate_with(self, start, time_steps).map(|run| run.states)
    }
}

impl Scheme {
    /// The states after `time_steps`.
    pub(crate) fn end(&self, model: &Model, start: &State, time_steps: TimeSteps) -> State {
        self.method.rollout(model, start, time_steps).unwrap().pop().unwrap()
    }

    /// The states of body `body` at 0, dt, ….
    pub(crate) fn course(
        &self,
        model: &Model,
        start: &State,
        time_steps: TimeSteps,
        body: usize,
    ) -> Vec<BodyState> {
        let run = self.method.rollout(model, start, time_steps).unwrap();
        run.iter().map(|state| state[body]).collect()
    }
}
