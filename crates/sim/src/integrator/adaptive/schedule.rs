//! The substeps of a step and where they lead.

use std::sync::Arc;

use prehend_autodiff::Scalar;

use super::Adaptive;
use super::sensitivity::Tangent;
use super::substep_controller::SubstepController;
use crate::body_state::{BodyState, Rows};
use crate::error::Result;
use crate::handle::BodyId;
use crate::integrator::Integrator;
use crate::integrator::runge_kutta::dormand_prince;
use crate::model::Model;
use crate::state::State;
use crate::time::Step;

/// The substeps of a step, found by values alone.
pub(super) struct Schedule {
    pub(super) substeps: Substeps,
    /// The states at its end, with the sensitivity.
    pub(super) states: Vec<BodyState<Tangent>>,
    /// Length of the substep that would come next \[s\].
    pub(super) next_substep: f64,
    /// For each of the bodies that were watched, how far its center came at most from where it would have been if it had gone on
    /// as it moved at the start \[m\].
    pub(super) deviations: Vec<f64>,
}

impl Schedule {
    /// The substeps of `step` from `states`; `next_substep` \[s\] is that of the step before.
    pub(super) fn find(
        settings: &Adaptive,
        model: Model,
        states: Vec<BodyState<Tangent>>,
        step: Step,
        next_substep: Option<f64>,
        watched: &[BodyId],
    ) -> Result<Self> {
        let mut substep_controller =
            SubstepController::new(settings, model, states, step, next_substep);
        let mut substeps = Vec::new();
        let mut watched: Vec<Watched> =
            watched.iter().map(|id| Watched::new(*id, substep_controller.state(*id))).collect();
        while let Some(substep) = substep_controller.advance()? {
            for body in &mut watched {
                body.moved(substep_controller.state(body.id), substep, step.start);
            }
            substeps.push(substep);
        }
        let next_substep = substep_controller.next_substep();
        let deviations = watched.into_iter().map(|body| body.farthest).collect();
        Ok(Self {
            substeps: Substeps(substeps.into()),
            states: substep_controller.states(),
            next_substep,
            deviations,
        })
    }
}

/// The substeps of a step.
#[derive(Clone, Debug)]
pub(super) struct Substeps(Arc<[Step]>);

impl Substeps {
    /// The states to which they lead in `model` from `states` in which `step` starts.
    pub(super) fn follow<S: Scalar>(
        &self,
        model: &Model<S>,
        states: &Rows<S>,
        step: Step,
    ) -> Vec<BodyState<S>> {
        let mut states = states.to_vec();
        let mut wrenches = model.wrenches_of(&states, step.index);
        for &substep in self.0.iter() {
            let mut trial = dormand_prince::step(model, &states, &wrenches, substep);
            states = trial.stages.pop().unwrap_or(states);
            wrenches = match substep.index {
                // Leaks of the first substep are not of the next one.
                0 => model.wrenches_of(&states, 1),
                _ => trial.wrenches,
            };
        }
        states
    }
}

impl Integrator for Substeps {
    fn step<S: Scalar>(&self, model: &Model<S>, state: &State<S>, step: Step) -> Result<State<S>> {
        Ok(state.with(self.follow(model, state.rows(), step), step.end()))
    }
}

/// A body and its deviation from uniform motion.
struct Watched {
    id: BodyId,
    start: BodyState,
    /// By how much position \[m\] and velocity \[m/s\] deviate now, and how far it has been off at most \[m\].
    off: f64,
    speed: f64,
    farthest: f64,
}

impl Watched {
    fn new(id: BodyId, start: BodyState) -> Self {
        Self { id, start, off: 0.0, speed: 0.0, farthest: 0.0 }
    }

    /// After a `substep` of a step that started at `time` \[s\] has led to `state`.
    fn moved(&mut self, state: BodyState, substep: Step, time: f64) {
        let [from, to] = [self.start, state].map(|state| state.pose.translation.vector);
        let uniform = from + self.start.linear * (substep.end() - time);
        let speed = (state.linear - self.start.linear).norm();
        self.farthest = self.farthest.max(self.off + substep.dt * speed.max(self.speed));
        self.off = (to - uniform).norm();
        self.speed = speed;
    }
}
