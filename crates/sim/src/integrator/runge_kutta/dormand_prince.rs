//! Dormand and Prince's pair of orders 5 and 4.

use nalgebra::Vector6;
use prehend_autodiff::Scalar;

use super::{Change, Stages};
use crate::state::State;
use crate::time::Step;
use crate::world::World;

/// Fractions of the step and weights of the slopes before, of the second stage to the last, which is the end of the step
/// (J. R. Dormand and P. J. Prince, "A family of embedded Runge–Kutta formulae", J. Comput. Appl. Math. 6, 1980).
const STAGES: [(f64, &[f64]); 6] = [
    (1.0 / 5.0, &[1.0 / 5.0]),
    (3.0 / 10.0, &[3.0 / 40.0, 9.0 / 40.0]),
    (4.0 / 5.0, &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0]),
    (8.0 / 9.0, &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0]),
    (1.0, &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0]),
    (1.0, &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0]),
];

/// Weights of the slopes in the fifth order less those in the fourth.
const ERROR: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// Where a step leads.
pub(in crate::integrator) struct Trial<S: Scalar> {
    /// The states at its stages, the last of which is its end.
    pub(in crate::integrator) stages: Vec<Vec<State<S>>>,
    /// The wrenches there: those that the next step starts with.
    pub(in crate::integrator) wrenches: Vec<Vector6<S>>,
    /// Of each free body and contact that sticks, by how much the solutions of fifth and fourth order differ.
    pub(in crate::integrator) error: Vec<Change<S>>,
}

/// A step from `states` with `wrenches` on them.
pub(in crate::integrator) fn step<S: Scalar>(
    world: &World<S>,
    states: &[State<S>],
    wrenches: &[Vector6<S>],
    step: Step,
) -> Trial<S> {
    let mut stages = Stages::new(world, states, wrenches, step);
    let (mut visited, mut wrenches) = (Vec::with_capacity(STAGES.len()), Vec::new());
    for (fraction, weights) in STAGES {
        let (states, acting) = stages.stage(fraction, weights);
        visited.push(states);
        wrenches = acting;
    }
    Trial { stages: visited, wrenches, error: stages.combined(&ERROR) }
}

impl<S: Scalar> Trial<S> {
    /// The states at its end.
    pub(in crate::integrator) fn end(&self) -> &[State<S>] {
        self.stages.last().map_or(&[], Vec::as_slice)
    }
}
