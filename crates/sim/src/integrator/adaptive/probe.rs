//! The direction along which a step's sensitivity is followed.

use prehend_autodiff::Fwd;
use prehend_geometry::SplitMix64;

use super::error_norm::ErrorNorm;
use super::planner::Probe;
use crate::state::State;

/// The states with derivatives along a direction in which everything that is free moves: each coordinate by half to all of what
/// `norm` calls one.
pub(super) fn seeded(states: &[State], norm: &ErrorNorm) -> Vec<State<Probe>> {
    let mut random = SplitMix64::new(7);
    let mut seeded: Vec<State<Probe>> = states.iter().map(State::lift).collect();
    for (body, units) in norm.units() {
        let tangent = units.map(|unit| {
            let (size, sign) = (0.5 + 0.5 * random.uniform(), (random.uniform() - 0.5).signum());
            Fwd { value: 0.0, derivative: [unit * size * sign] }
        });
        seeded[body] = states[body].retract(&tangent);
    }
    seeded
}
