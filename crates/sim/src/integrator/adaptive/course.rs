//! The parts of a step and where they lead.

use prehend_autodiff::Scalar;

use super::Adaptive;
use super::planner::{Planner, Probe};
use crate::error::SimulationError;
use crate::integrator::runge_kutta::dormand_prince;
use crate::state::State;
use crate::time::Step;
use crate::world::World;
use crate::world::body_id::BodyId;

/// The parts of a step, found by values alone.
pub(super) struct Course {
    parts: Vec<Step>,
    /// The states at its end, with the sensitivity.
    pub(super) states: Vec<State<Probe>>,
    /// Length of the part that would come next \[s\].
    pub(super) next_part: f64,
}

impl Course {
    /// The parts of `step` from `states`; none if the center of a body moves by more than its `limits` \[m\]. `next_part` \[s\] is
    /// that of the step before.
    pub(super) fn find(
        settings: &Adaptive,
        world: World,
        states: Vec<State<Probe>>,
        step: Step,
        next_part: Option<f64>,
        limits: &[(BodyId, f64)],
    ) -> Result<Option<Self>, SimulationError> {
        let mut planner = Planner::new(settings, world, states, step, next_part);
        let speed = |planner: &Planner, id: BodyId| planner.state(id).linear.norm();
        let mut parts = Vec::new();
        let mut moved = vec![0.0; limits.len()];
        let mut speeds: Vec<f64> = limits.iter().map(|(id, _)| speed(&planner, *id)).collect();
        while let Some(part) = planner.advance()? {
            for (i, (id, limit)) in limits.iter().enumerate() {
                let speed = speed(&planner, *id);
                moved[i] += part.dt * speed.max(speeds[i]);
                speeds[i] = speed;
                if moved[i] > *limit {
                    return Ok(None);
                }
            }
            parts.push(part);
        }
        let next_part = planner.next_part();
        Ok(Some(Self { parts, states: planner.states(), next_part }))
    }

    /// The states to which the same parts lead in `world`, with derivatives, from `states` in which `step` starts.
    pub(super) fn follow<S: Scalar>(
        &self,
        world: &World<S>,
        states: &[State<S>],
        step: Step,
    ) -> Vec<State<S>> {
        let mut states = states.to_vec();
        let mut wrenches = world.wrenches(&states, step.index);
        for &part in &self.parts {
            let mut trial = dormand_prince::step(world, &states, &wrenches, part);
            states = trial.stages.pop().unwrap_or(states);
            wrenches = match part.index {
                // Leaks of the first part are not of the next one.
                0 => world.wrenches(&states, 1),
                _ => trial.wrenches,
            };
        }
        states
    }
}
