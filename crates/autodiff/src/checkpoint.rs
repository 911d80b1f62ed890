//! Reverse mode through thousands of steps in the memory of one (checkpointing).
//!
//! A loop recorded as it stands keeps every operation of every step. [`rollout`] keeps a few states instead,
//! and the sweep runs the loop again from them, one step recorded at a time:
//!
//! ```
//! use prehend_autodiff::checkpoint::{self, Step};
//! use prehend_autodiff::{Recording, Scalar};
//!
//! /// A damped pendulum of angle `state[0]` and rate `state[1]`; the damping is the parameter.
//! struct Pendulum;
//!
//! impl Step for Pendulum {
//!     fn advance<S: Scalar>(&self, _index: usize, state: &mut [S], parameters: &[S]) {
//!         let dt = S::constant(1e-3);
//!         let rate = state[1];
//!         state[1] -= (state[0].sin() + parameters[0] * rate) * dt;
//!         let rate = state[1];
//!         state[0] += rate * dt;
//!     }
//! }
//!
//! let recording = Recording::start();
//! let [angle, rate, damping] = recording.variables([0.5, 0.0, 0.1]);
//! let end = checkpoint::rollout(Pendulum, 10_000, 30, &[angle, rate], &[damping]);
//! let adjoints = recording.gradient(end[0]);
//! assert!(recording.statistics().nodes < 10 && adjoints.wrt(damping) != 0.0);
//! ```

mod schedule;

use std::cell::RefCell;

use crate::record::custom;
use crate::recording::Recording;
use crate::scalar::Scalar;
use crate::var::Var;
use crate::vjp::CustomVjp;
use schedule::Snapshots;

/// One step of a loop, written once for all scalars.
///
/// The tape owns the step until the recording ends, so large data that it refers to is best shared (`Arc`).
pub trait Step: 'static {
    /// Turns `state` before step `index` (from 0) into the state after it; entries left alone stay as they are.
    ///
    /// It is called again for the same step, so the result may depend on nothing else that changes.
    /// Parameters are the numbers, the same for all steps, by which one differentiates; constants
    /// belong in `self`. A sum over the steps, such as a running cost, is one more entry of the state.
    fn advance<S: Scalar>(&self, index: usize, state: &mut [S], parameters: &[S]);
}

/// The state after `steps` steps from `state`, recorded as one operation.
///
/// At most `snapshots` states are held (at least the initial one) besides the one in hand, and the tape of one
/// step. Which ones is the binomial schedule of A. Griewank, A. Walther, "Algorithm 799: revolve", ACM Trans.
/// Math. Softw. 26 (2000), which computes the fewest steps again. Besides the `steps` steps that the sweep
/// records, recording and sweep together make r·(`steps` + 1) − C(`snapshots` + r, `snapshots` + 1) plain
/// calls of [`Step::advance`], with r the least for which C(`snapshots` + r, r) > `steps`; none
/// is made more than r times. `usize::MAX` snapshots keep every state and make each once; [`snapshots_for`]
/// says how many are needed for a given r.
///
/// The derivatives do not depend on `snapshots`, to the last bit. They are those of the loop recorded as it
/// stands if its states become nodes of the tape after each step (to the last bit if `state` and `parameters`
/// are distinct variables, not used elsewhere, and `advance` computes the same values with `f64` and [`Var`]).
///
/// # Panics
/// If an input belongs to another recording (see [`Var`]).
pub fn rollout(
    step: impl Step,
    steps: usize,
    snapshots: usize,
    state: &[Var],
    parameters: &[Var],
) -> Vec<Var> {
    let inputs = [state, parameters].concat();
    let parameters: Vec<f64> = parameters.iter().map(|p| p.value()).collect();
    let mut states = Snapshots::new(state.iter().map(|s| s.value()).collect::<Vec<_>>(), snapshots);
    // The state at the end counts as one of the chain: the sweep begins with the one before it.
    let end = states.state(steps, |index, state| step.advance(index, state, &parameters));
    custom(&inputs, &end, Rollout { step, steps, parameters, states: RefCell::new(states) })
}

/// The fewest snapshots with which [`rollout`] makes no step more than `times` times (at least 1) before it is
/// recorded. For 1 these are `steps`, for 2 about √(2 `steps`), for 3 about ∛(6 `steps`).
pub fn snapshots_for(steps: usize, times: usize) -> usize {
    schedule::fewest_snapshots(steps.saturating_add(1), times)
}

struct Rollout<M> {
    step: M,
    steps: usize,
    parameters: Vec<f64>,
    /// Changes in a sweep: going back frees snapshots for the states between the earlier ones.
    states: RefCell<Snapshots<Vec<f64>>>,
}

impl<M: Step> CustomVjp for Rollout<M> {
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
        let (by_state, by_parameter) = input_adjoints.split_at_mut(output_adjoints.len());
        by_state.copy_from_slice(output_adjoints);
        for index in (0..self.steps).rev() {
            // Nothing flows back any more.
            if by_state.iter().all(|adjoint| *adjoint == 0.0) {
                break;
            }
            let state = self.states.borrow_mut().state(index, |index, state| {
                self.step.advance(index, state, &self.parameters);
            });
            let recording = Recording::start();
            let before = recording.variables_of(&state);
            let parameters = recording.variables_of(&self.parameters);
            let mut after = before.clone();
            self.step.advance(index, &mut after, &parameters);
            // The order of one long tape: what later steps gave the parameters comes first, then the
            // states from the last to the first. An adjoint of 0 meets no slope there, which may be infinite.
            let totals = parameters.iter().zip(&*by_parameter);
            let seeds: Vec<(Var, f64)> = totals
                .chain(after.iter().zip(&*by_state).rev())
                .map(|(&var, &adjoint)| (var, adjoint))
                .filter(|(_, adjoint)| *adjoint != 0.0)
                .collect();
            let adjoints = recording.vjp(&seeds);
            let wrt = |vars: &[Var], out: &mut [f64]| {
                out.iter_mut().zip(vars).for_each(|(out, &var)| *out = adjoints.wrt(var));
            };
            wrt(&before, by_state);
            wrt(&parameters, by_parameter);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::rc::Rc;

    use super::*;
    use crate::check::finite_difference_gradient;
    use crate::fwd::Fwd;

    /// Every way for an output to depend on its inputs: joined, fused, passed on, swapped, constant, and
    /// several outputs fused with one parameter.
    #[derive(Default)]
    struct Mixed {
        plain: Rc<Cell<usize>>,
        recorded: Rc<Cell<usize>>,
    }

    impl Step for Mixed {
        fn advance<S: Scalar>(&self, index: usize, x: &mut [S], p: &[S]) {
            let is_plain = std::any::type_name::<S>() == "f64";
            let count = if is_plain { &self.plain } else { &self.recorded };
            count.set(count.get() + 1);
            let phase = S::constant(index as f64 * 0.1);
            let pull = (x[0] * p[0] + phase).sin() * p[1];
            let turned = x[1] * S::constant(0.9);
            x[0] += pull * x[2].cos() / S::constant(7.0);
            x[1] = x[2] - p[0] * S::constant(0.01);
            x[2] = turned + p[1] * p[1] * pull;
            x[4] = if index % 5 == 4 { S::constant(0.3) } else { x[4] * x[0].cos() + x[4] };
            x[3] = x[3] * S::constant(0.8) + (x[5] + x[6]) * S::constant(300.0) - x[7];
            // What these give the parameter cancels but for rounding, which shows the order of the sum.
            x[5] = p[1];
            x[6] = -p[1];
            x[7] = p[1].cos();
        }
    }

    const STATE: [f64; 8] = [0.3, -0.4, 1.1, 0.7, 0.2, 5.0, -4.9, 7.0];
    const PARAMETERS: [f64; 2] = [1.3, -0.6];

    fn loss<S: Scalar>(end: &[S], weights: &[f64]) -> S {
        end.iter().zip(weights).fold(S::zero(), |sum, (x, w)| sum + *x * *x * S::constant(*w))
    }

    fn plain_loss<S: Scalar>(steps: usize, x: &[S], weights: &[f64]) -> S {
        let mut state = x[..8].to_vec();
        (0..steps).for_each(|i| Mixed::default().advance(i, &mut state, &x[8..]));
        loss(&state, weights)
    }

    /// Bits of the gradient by every input, and of the loss, with `run` for the loop.
    fn bits(weights: &[f64], run: impl FnOnce(&[Var], &[Var]) -> Vec<Var>) -> Vec<u64> {
        let recording = Recording::start();
        let (state, parameters) = (recording.variables(STATE), recording.variables(PARAMETERS));
        let output = loss(&run(&state, &parameters), weights);
        let adjoints = recording.gradient(output);
        let by = state.iter().chain(&parameters).map(|&v| adjoints.wrt(v).to_bits());
        by.chain([output.value().to_bits()]).collect()
    }

    /// A node of its own.
    struct Identity;

    impl CustomVjp for Identity {
        fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
            input_adjoints[0] += output_adjoints[0];
        }
    }

    #[test]
    fn bits_are_those_of_the_recorded_loop_whatever_the_snapshots() {
        for weights in [
            [1.0, -2.0, 0.5, 0.3, 0.7, 0.9, 1.1, 0.8],
            [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            [0.0; 8],
        ] {
            for steps in [0, 1, 2, 3, 10, 57] {
                let reference = bits(&weights, |state, parameters| {
                    let mut state = state.to_vec();
                    for index in 0..steps {
                        Mixed::default().advance(index, &mut state, parameters);
                        state
                            .iter_mut()
                            .for_each(|x| *x = custom(&[*x], &[x.value()], Identity)[0]);
                    }
                    state
                });
                for snapshots in [0, 1, 2, 3, 4, 7, 56, 57, 58, 1000, usize::MAX] {
                    let checkpointed = bits(&weights, |state, parameters| {
                        rollout(Mixed::default(), steps, snapshots, state, parameters)
                    });
                    assert_eq!(checkpointed, reference, "{steps} steps, {snapshots} snapshots");
                }
            }
        }
    }

    #[test]
    fn gradients_match_forward_mode_and_differences() {
        let (steps, weights) = (23, [1.0, -2.0, 0.5, 0.3, 0.7, 0.9, 1.1, 0.8]);
        let x: [f64; 10] = std::array::from_fn(|i| [&STATE[..], &PARAMETERS].concat()[i]);
        let (value, reverse) = crate::recording::gradient(
            |x| loss(&rollout(Mixed::default(), steps, 3, &x[..8], &x[8..]), &weights),
            &x,
        );
        let forward = plain_loss(steps, &Fwd::<10>::variables(x), &weights);
        let differences = finite_difference_gradient(|x| plain_loss(steps, x, &weights), &x, 1e-4);
        assert_eq!(value, forward.value);
        for i in 0..10 {
            assert!((reverse[i] - forward.derivative[i]).abs() < 1e-11, "{i}");
            assert!((reverse[i] - differences[i]).abs() < 1e-8, "{i}");
        }
    }

    #[test]
    fn steps_are_computed_as_often_as_promised() {
        for (steps, snapshots) in [(0, 1), (1, 1), (9, 1), (9, 3), (100, 5), (100, 100), (34, 7)] {
            let (plain, recorded) = (Rc::default(), Rc::default());
            let step = Mixed { plain: Rc::clone(&plain), recorded: Rc::clone(&recorded) };
            let recording = Recording::start();
            let [state, parameters] = [&STATE[..], &PARAMETERS]
                .map(|v| v.iter().map(|&x| recording.variable(x)).collect::<Vec<_>>());
            let end = rollout(step, steps, snapshots, &state, &parameters);
            let counts = || [&plain, &recorded].map(|c: &Rc<Cell<usize>>| c.get());
            assert_eq!(counts(), [steps, 0]);
            let first = recording.gradient(end[3]);
            let beta = |s: usize, r: usize| (1..=r).fold(1, |b, k| b * (s + k) / k);
            let r = (0..).find(|&r| beta(snapshots, r) > steps).unwrap();
            let promised = if r == 0 { 0 } else { r * (steps + 1) - beta(snapshots + 1, r - 1) };
            assert_eq!(counts(), [promised, steps], "{steps} steps, {snapshots} snapshots");
            assert!(r == 0 || snapshots_for(steps, r) <= snapshots);
            // The sweep has used up the snapshots; another finds the same.
            let second = recording.gradient(end[3]);
            for &x in state.iter().chain(&parameters) {
                assert_eq!(first.wrt(x).to_bits(), second.wrt(x).to_bits());
            }
        }
    }

    #[test]
    fn nothing_to_differentiate_is_no_trouble() {
        struct Still;
        impl Step for Still {
            fn advance<S: Scalar>(&self, _: usize, _: &mut [S], _: &[S]) {}
        }
        struct Reset;
        impl Step for Reset {
            fn advance<S: Scalar>(&self, _: usize, state: &mut [S], _: &[S]) {
                state[0] = S::constant(2.0);
            }
        }
        let recording = Recording::start();
        let x = recording.variable(3.0);
        assert!(rollout(Still, 5, 2, &[], &[x]).is_empty());
        let still = rollout(Still, 5, 2, &[x], &[])[0];
        assert_eq!((still.value(), recording.gradient(still).wrt(x)), (3.0, 1.0));
        let reset = rollout(Reset, 5, 2, &[x], &[])[0];
        assert_eq!((reset.value(), recording.gradient(reset).wrt(x)), (2.0, 0.0));
        let constant = rollout(Reset, 5, 2, &[Var::from(1.0)], &[])[0];
        assert_eq!(recording.gradient(constant * x).wrt(x), 2.0);
    }

    #[test]
    fn infinite_slopes_of_what_is_not_used_stay_out() {
        struct Roots;
        impl Step for Roots {
            fn advance<S: Scalar>(&self, _: usize, state: &mut [S], parameters: &[S]) {
                state[0] += state[0] * parameters[0];
                state[1] = (state[1] * S::zero()).sqrt();
            }
        }
        let (_, gradient) = crate::recording::gradient(
            |x| rollout(Roots, 3, 1, &x[..2], &x[2..])[0],
            &[1.0, 2.0, 1.0],
        );
        assert_eq!(gradient, [8.0, 0.0, 12.0]);
    }

    #[test]
    fn rollouts_nest() {
        struct Power;
        impl Step for Power {
            fn advance<S: Scalar>(&self, _: usize, state: &mut [S], parameters: &[S]) {
                state[0] *= parameters[0];
            }
        }
        // A rollout whose start is the end of another, both of one parameter: x·p⁷, weighted by p.
        let value = |x: &[Var]| {
            let middle = rollout(Power, 4, 2, &x[..1], &x[1..]);
            rollout(Power, 3, 1, &middle, &x[1..])[0] * x[1]
        };
        let (value, gradient) = crate::recording::gradient(value, &[3.0, 2.0]);
        assert_eq!((value, gradient), (768.0, vec![256.0, 3072.0]));
    }
}
