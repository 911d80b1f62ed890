//! Integrators by name.

use prehend_autodiff::Scalar;
use prehend_sim::{
    Adaptive, Integrator, Model, RungeKutta4, SemiImplicitEuler, SimulationError, State, Step,
    integrator::BackwardEuler,
};
use pyo3::prelude::*;

use crate::error::wrong;
use crate::threads::is_interrupted;

/// One of the integrators.
#[derive(Clone, Copy, Debug)]
pub(crate) enum AnyIntegrator {
    Adaptive(Adaptive),
    SemiImplicitEuler,
    RungeKutta4,
    BackwardEuler,
}

const NAMES: &str = "adaptive, semi_implicit_euler, runge_kutta_4, backward_euler";

impl AnyIntegrator {
    /// The one called `name`; `tolerance` is that of the adaptive one.
    pub(crate) fn of(name: &str, tolerance: Option<f64>) -> PyResult<Self> {
        let own = match name {
            "adaptive" => {
                let default = Adaptive::default();
                let scale = tolerance.map_or(1.0, |tolerance| tolerance / default.tolerance);
                if !(scale > 0.0 && scale.is_finite()) {
                    return Err(wrong("tolerance must be positive and finite"));
                }
                return Ok(Self::Adaptive(Adaptive {
                    tolerance: default.tolerance * scale,
                    sensitivity_tolerance: default.sensitivity_tolerance * scale,
                    ..default
                }));
            }
            "semi_implicit_euler" => Self::SemiImplicitEuler,
            "runge_kutta_4" => Self::RungeKutta4,
            "backward_euler" => Self::BackwardEuler,
            _ => {
                return Err(wrong(format!(
                    "there is no integrator called '{name}': one of {NAMES}"
                )));
            }
        };
        match tolerance {
            Some(_) => Err(wrong(format!("{name} has no tolerance: adaptive has"))),
            None => Ok(own),
        }
    }
}

/// The integrator within, whichever it is.
macro_rules! each {
    ($own:expr, $integrator:ident => $call:expr) => {
        match $own {
            AnyIntegrator::Adaptive($integrator) => $call,
            AnyIntegrator::SemiImplicitEuler => {
                let $integrator = &SemiImplicitEuler;
                $call
            }
            AnyIntegrator::RungeKutta4 => {
                let $integrator = &RungeKutta4;
                $call
            }
            AnyIntegrator::BackwardEuler => {
                let $integrator = &BackwardEuler;
                $call
            }
        }
    };
}

impl Integrator for AnyIntegrator {
    fn step<S: Scalar>(
        &self,
        model: &Model<S>,
        state: &State<S>,
        step: Step,
    ) -> Result<State<S>, SimulationError> {
        if is_interrupted() {
            return Err(SimulationError::Interrupted);
        }
        each!(self, integrator => integrator.step(model, state, step))
    }

    fn stability_limit(&self) -> f64 {
        each!(self, integrator => integrator.stability_limit())
    }

    fn evaluates_forces_once(&self) -> bool {
        each!(self, integrator => integrator.evaluates_forces_once())
    }

    fn finds_contacts(&self) -> bool {
        each!(self, integrator => integrator.finds_contacts())
    }

    fn check_differentiable<S: Scalar>(&self, model: &Model<S>) -> Result<(), SimulationError> {
        each!(self, integrator => integrator.check_differentiable(model))
    }

    fn controls_error(&self) -> bool {
        each!(self, integrator => integrator.controls_error())
    }
}
