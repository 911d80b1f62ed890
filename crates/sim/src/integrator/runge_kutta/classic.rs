//! The classic Runge–Kutta method.

use prehend_autodiff::Scalar;

use super::Stages;
use crate::error::Result;
use crate::integrator::Integrator;
use crate::model::Model;
use crate::state::State;
use crate::time::Step;

/// The classic Runge–Kutta method, fourth order on smooth forces, four evaluations of them a step.
///
/// Driven bodies are where they are at each stage. Forces with kinks, such as those of unsmoothed gaps, cost the order in the
/// steps that cross them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RungeKutta4;

impl Integrator for RungeKutta4 {
    fn step<S: Scalar>(&self, model: &Model<S>, state: &State<S>, step: Step) -> Result<State<S>> {
        let wrenches = model.wrenches_of(state.rows(), step.index);
        let mut stages = Stages::new(model, state.rows(), &wrenches, step, 4);
        stages.stage(0.5, &[0.5]);
        stages.stage(0.5, &[0.0, 0.5]);
        stages.stage(1.0, &[0.0, 0.0, 1.0]);
        let end = stages.end(&[1.0, 2.0, 2.0, 1.0].map(|weight| weight / 6.0));
        Ok(state.with(end, step.end()))
    }

    /// The left half of the disc of radius 2.6 is inside the stability region, which ends at 2.83 on the imaginary axis.
    fn stability_limit(&self) -> f64 {
        2.6
    }
}
