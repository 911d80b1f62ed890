//! Steps that follow each other without any choice among them.

use nalgebra::Vector6;

use crate::problem::{Block, State};
use crate::strategy::{Iteration, Trace};

/// What a strategy makes of a state.
pub(super) struct Advance {
    /// The value that the strategy lowers.
    pub(super) value: f64,
    /// The twist of the object to make next, and its length where a rotation counts by how far it moves the
    /// object's surface \[m\].
    pub(super) step: (Vector6<f64>, f64),
}

/// Makes `iterations` steps from `state`, fewer once one is no longer than `last_step` \[m\] or `visit`, which is
/// called at every state, returns false. `name` is that of the value.
pub(super) fn walk(
    name: &str,
    mut state: State,
    iterations: usize,
    last_step: f64,
    mut advance: impl FnMut(&State, usize) -> Advance,
    mut visit: impl FnMut(&State, &Iteration) -> bool,
) -> Trace {
    let mut trace = Trace::new([name].into_iter());
    for index in 0..=iterations {
        let Advance { value, step: (step, length) } = advance(&state, index);
        let iteration = Iteration { index, values: vec![value], weights: vec![1.0], step: length };
        let go_on = visit(&state, &iteration);
        trace.iterations.push(iteration);
        if !go_on || length <= last_step {
            break;
        }
        state = state.moved(Block::ObjectPose, step.as_slice());
    }
    trace
}
