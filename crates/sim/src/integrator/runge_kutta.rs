//! Explicit Runge–Kutta methods, on the manifold of poses.

pub(crate) mod classic;
pub(super) mod dormand_prince;

use nalgebra::{Vector3, Vector6};
use prehend_autodiff::Scalar;
use prehend_autodiff::lie::so3_exp;

use crate::body::RigidBody;
use crate::contact::wrench::stack;
use crate::state::State;
use crate::time::Step;
use crate::world::World;
use crate::world::body_id::BodyId;

/// Of a body: position of the center of mass, its velocity, rotation vector, and angular momentum; or their rates. Of a contact
/// that sticks: the two halves of its deflection, and nothing.
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
    free: Vec<Free<'a, S>>,
    /// Of each stage, those of the free bodies, then of the contacts that stick.
    slopes: Vec<Vec<Change<S>>>,
}

/// A body that forces move.
struct Free<'a, S: Scalar> {
    id: BodyId,
    rigid: &'a RigidBody<S>,
    /// Angular momentum at the start of the step.
    momentum: Vector3<S>,
}

impl<'a, S: Scalar> Stages<'a, S> {
    /// The first stage, of a step that starts with `wrenches` on the bodies.
    pub(super) fn new(
        world: &'a World<S>,
        states: &'a [State<S>],
        wrenches: &[Vector6<S>],
        step: Step,
    ) -> Self {
        let free = |id: BodyId| {
            let (rigid, state) = (world.bodies[id].rigid()?, &states[id]);
            let momentum = rigid.momentum(&state.pose.rotation, &state.angular);
            Some(Free { id, rigid, momentum })
        };
        let free: Vec<Free<'_, S>> = world.free_bodies().into_iter().filter_map(free).collect();
        let mut stages = Self { world, states, step, slopes: Vec::new(), free };
        let none = vec![[Vector3::zeros(); 4]; stages.moving()];
        stages.slopes.push(stages.rates(states, &none, wrenches));
        stages
    }

    /// The states at `fraction` of the step, which `weights` of the slopes lead to, driven bodies where they are then;
    /// and the wrenches there, whose slope is that of the next stage.
    pub(super) fn stage(
        &mut self,
        fraction: f64,
        weights: &[f64],
    ) -> (Vec<State<S>>, Vec<Vector6<S>>) {
        let change = self.combined(weights);
        let mut states = self.moved(&change);
        self.world.drive(&mut states, self.step.start + fraction * self.step.dt);
        let wrenches = self.world.wrenches(&states, self.step.index);
        self.slopes.push(self.rates(&states, &change, &wrenches));
        (states, wrenches)
    }

    /// The states that `weights` of the slopes lead to.
    pub(super) fn end(&self, weights: &[f64]) -> Vec<State<S>> {
        self.moved(&self.combined(weights))
    }

    /// Of each free body and contact that sticks, the step's length times the sum of the slopes with `weights`.
    pub(super) fn combined(&self, weights: &[f64]) -> Vec<Change<S>> {
        let of = |i: usize| {
            let mut sum: Change<S> = [Vector3::zeros(); 4];
            for (slopes, weight) in self.slopes.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
                let weight = weight * self.step.dt;
                for (sum, slope) in sum.iter_mut().zip(&slopes[i]) {
                    sum.x += slope.x.times(weight);
                    sum.y += slope.y.times(weight);
                    sum.z += slope.z.times(weight);
                }
            }
            sum
        };
        (0..self.moving()).map(of).collect()
    }

    /// The states after `change`.
    fn moved(&self, change: &[Change<S>]) -> Vec<State<S>> {
        let mut moved = self.states.to_vec();
        for (free, [position, velocity, turn, momentum]) in self.free.iter().zip(change) {
            let state = &mut moved[free.id];
            state.pose.translation.vector += position;
            state.linear += velocity;
            state.pose.rotation = so3_exp(turn) * state.pose.rotation;
            state.pose.rotation.renormalize_fast();
            state.angular = free.rigid.angular(&state.pose.rotation, &(free.momentum + momentum));
        }
        let deflections = moved.iter_mut().skip(self.world.bodies.len());
        for (state, [linear, angular, ..]) in deflections.zip(&change[self.free.len()..]) {
            *state = state.deflected(&stack(linear, angular));
        }
        moved
    }

    /// Free bodies and contacts that stick.
    fn moving(&self) -> usize {
        self.free.len() + self.states.len() - self.world.bodies.len()
    }

    /// The rates of change at `states` under `wrenches`, where `change` has led to.
    fn rates(
        &self,
        states: &[State<S>],
        change: &[Change<S>],
        wrenches: &[Vector6<S>],
    ) -> Vec<Change<S>> {
        let rate = |(free, change): (&Free<'_, S>, &Change<S>)| {
            let (state, turn, wrench) = (&states[free.id], &change[2], &wrenches[free.id]);
            let (force, torque) = (wrench.fixed_rows::<3>(0), wrench.fixed_rows::<3>(3));
            let once = turn.cross(&state.angular);
            let twice = turn.cross(&once);
            let turning =
                state.angular - once.map(|x| x.times(0.5)) + twice.map(|x| x.times(1.0 / 12.0));
            let acceleration = self.world.gravity + force * (S::one() / free.rigid.mass());
            [state.linear, acceleration, turning, torque.into_owned()]
        };
        let rates = self.free.iter().zip(change).map(rate);
        let deflecting = |rate: &Vector6<S>| {
            let (linear, angular) = (rate.fixed_rows::<3>(0), rate.fixed_rows::<3>(3));
            [linear.into_owned(), angular.into_owned(), Vector3::zeros(), Vector3::zeros()]
        };
        rates.chain(wrenches[self.world.bodies.len()..].iter().map(deflecting)).collect()
    }
}
