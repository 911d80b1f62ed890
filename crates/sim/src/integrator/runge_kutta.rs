//! Explicit Runge–Kutta methods, on the manifold of poses.

pub(crate) mod classic;
pub(super) mod dormand_prince;

use nalgebra::{Vector3, Vector6};
use prehend_autodiff::Scalar;
use prehend_autodiff::lie::so3_exp;

use crate::state::State;
use crate::time::Step;
use crate::world::World;

/// Of a body: position of the center of mass, its velocity, rotation vector, and angular momentum; or their rates.
///
/// Rotations are R = exp(θ) R₀ with the rotation vector θ from the start of the step, whose rate is
/// dexp⁻¹(θ) ω = ω − θ×ω/2 + θ×(θ×ω)/12 to the order that counts (H. Munthe-Kaas, "High order Runge–Kutta methods on
/// manifolds", Appl. Numer. Math. 29, 1999). Angular momentum L = I(R)ω is what is integrated, so it is conserved to
/// rounding.
pub(super) type Change<S> = [Vector3<S>; 4];

/// One step of an explicit method: where it starts, and the slopes of the stages so far.
pub(super) struct Stages<'a, S: Scalar> {
    world: &'a World<S>,
    states: &'a [State<S>],
    step: Step,
    slopes: Vec<Vec<Change<S>>>,
}

impl<'a, S: Scalar> Stages<'a, S> {
    /// The first stage, of a step that starts with `wrenches` on the bodies.
    pub(super) fn new(
        world: &'a World<S>,
        states: &'a [State<S>],
        wrenches: &[Vector6<S>],
        step: Step,
    ) -> Self {
        let none = vec![[Vector3::zeros(); 4]; states.len()];
        let slopes = vec![rates(world, states, &none, wrenches)];
        Self { world, states, step, slopes }
    }

    /// The states at `fraction` of the step, which `weights` of the slopes lead to, driven bodies where they are then; and the
    /// wrenches there, whose slope is that of the next stage.
    pub(super) fn stage(
        &mut self,
        fraction: f64,
        weights: &[f64],
    ) -> (Vec<State<S>>, Vec<Vector6<S>>) {
        let change = self.combined(weights);
        let mut states = moved(self.world, self.states, &change);
        self.world.drive(&mut states, self.step.start + fraction * self.step.dt);
        let wrenches = self.world.wrenches(&states, self.step.index);
        self.slopes.push(rates(self.world, &states, &change, &wrenches));
        (states, wrenches)
    }

    /// The states that `weights` of the slopes lead to.
    pub(super) fn end(&self, weights: &[f64]) -> Vec<State<S>> {
        moved(self.world, self.states, &self.combined(weights))
    }

    /// The step's length times the sum of the slopes with `weights`.
    pub(super) fn combined(&self, weights: &[f64]) -> Vec<Change<S>> {
        let mut sum = vec![[Vector3::zeros(); 4]; self.states.len()];
        for (slopes, weight) in self.slopes.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
            for (sum, slope) in sum.iter_mut().flatten().zip(slopes.iter().flatten()) {
                *sum += slope.map(|x| x.times(weight * self.step.dt));
            }
        }
        sum
    }
}

/// The rates of change at `states` under `wrenches`, where `change` has led to.
fn rates<S: Scalar>(
    world: &World<S>,
    states: &[State<S>],
    change: &[Change<S>],
    wrenches: &[Vector6<S>],
) -> Vec<Change<S>> {
    let rate = |body: usize| {
        let Some(rigid) = world.bodies[body].rigid() else { return [Vector3::zeros(); 4] };
        let (state, turn, wrench) = (&states[body], &change[body][2], &wrenches[body]);
        let (force, torque) = (wrench.fixed_rows::<3>(0), wrench.fixed_rows::<3>(3));
        let once = turn.cross(&state.angular);
        let twice = turn.cross(&once);
        let turning =
            state.angular - once.map(|x| x.times(0.5)) + twice.map(|x| x.times(1.0 / 12.0));
        [state.linear, world.gravity + force / rigid.mass(), turning, torque.into_owned()]
    };
    (0..states.len()).map(rate).collect()
}

/// `states` after `change`.
fn moved<S: Scalar>(world: &World<S>, states: &[State<S>], change: &[Change<S>]) -> Vec<State<S>> {
    let mut moved = states.to_vec();
    for ((body, state), [position, velocity, turn, momentum]) in
        world.bodies.iter().zip(&mut moved).zip(change)
    {
        let Some(rigid) = body.rigid() else { continue };
        let momentum = rigid.world_inertia(&state.pose.rotation) * state.angular + momentum;
        state.pose.translation.vector += position;
        state.linear += velocity;
        state.pose.rotation = so3_exp(turn) * state.pose.rotation;
        state.pose.rotation.renormalize_fast();
        state.angular = rigid.inverse_world_inertia(&state.pose.rotation) * momentum;
    }
    moved
}
