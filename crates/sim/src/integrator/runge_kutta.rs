//! Explicit Runge–Kutta methods, on the manifold of poses.

pub(crate) mod classic;
pub(super) mod dormand_prince;

use nalgebra::{Matrix3, Vector3, Vector6};

use prehend_autodiff::lie::cross_matrix;
use prehend_autodiff::rigid::turned;
use prehend_autodiff::{LocalFunction, Scalar};

use crate::body::RigidBody;
use crate::body_state::{BodyState, Rows};
use crate::handle::BodyId;
use crate::model::Model;
use crate::model::body::Body;
use crate::spatial::spatial;
use crate::time::Step;

/// Change of a state, or its rate. Body: position of the center of mass, its velocity, rotation vector, angular momentum. Joint:
/// position, velocity, rotation vector, angular velocity. Contact with bristles: both halves of its deflection, two zeros.
///
/// Rotations are R = exp(θ) R₀ with the rotation vector θ from the start of the step, whose rate is
/// dexp⁻¹(θ) ω = ω − θ×ω/2 + θ×(θ×ω)/12 to the order that counts (H. Munthe-Kaas, "High order Runge–Kutta methods on
/// manifolds", Appl. Numer. Math. 29, 1999). Angular momentum L = I(R)ω is what is integrated, so it is conserved to
/// rounding.
pub(super) type Change<S> = [Vector3<S>; 4];

/// One step of an explicit method: where it starts, and the slopes of the stages so far.
pub(super) struct Stages<'a, S: Scalar> {
    model: &'a Model<S>,
    states: &'a Rows<S>,
    step: Step,
    free: Vec<Free<'a, S>>,
    /// Free bodies, joints and contacts with bristles.
    moving: usize,
    /// For each stage, those of the free bodies, then of the joints and of the contacts with bristles.
    slopes: Vec<Change<S>>,
    /// Wrenches that led to the last stage.
    change: Vec<Change<S>>,
}

/// A body that forces move.
struct Free<'a, S: Scalar> {
    id: BodyId,
    rigid: &'a RigidBody<S>,
    /// Angular momentum at the start of the step.
    momentum: Vector3<S>,
}

impl<'a, S: Scalar> Stages<'a, S> {
    /// The first of `count` stages, of a step that starts with `wrenches` on the bodies.
    pub(super) fn new(
        model: &'a Model<S>,
        states: &'a Rows<S>,
        wrenches: &[Vector6<S>],
        step: Step,
        count: usize,
    ) -> Self {
        let free = |(id, body): (usize, &'a Body<S>)| {
            let (rigid, state) = (body.rigid()?, &states[id]);
            let momentum = rigid.momentum(&state.pose.rotation, &state.angular);
            Some(Free { id: BodyId(id), rigid, momentum })
        };
        let free: Vec<Free<'_, S>> = model.bodies.iter().enumerate().filter_map(free).collect();
        let moving = free.len() + states.len() - model.bodies.len();
        let change = vec![[Vector3::zeros(); 4]; moving];
        let slopes = Vec::with_capacity(count * moving);
        let mut stages = Self { model, states, step, free, moving, slopes, change };
        stages.add_slopes(states, wrenches);
        stages
    }

    /// The states at `fraction` of the step, which `weights` of the slopes lead to, kinematic bodies where they are then;
    /// and the wrenches there, whose slope is that of the next stage.
    pub(super) fn stage(
        &mut self,
        fraction: f64,
        weights: &[f64],
    ) -> (Vec<BodyState<S>>, Vec<Vector6<S>>) {
        let mut change = std::mem::take(&mut self.change);
        change.fill([Vector3::zeros(); 4]);
        self.add_combined(weights, &mut change);
        let mut states = self.moved(&change);
        self.change = change;
        self.model.place_bodies(&mut states, self.step.start + fraction * self.step.dt);
        let wrenches = self.model.wrenches_of(&states, self.step.index);
        self.add_slopes(&states, &wrenches);
        (states, wrenches)
    }

    /// The states that `weights` of the slopes lead to.
    pub(super) fn end(&self, weights: &[f64]) -> Vec<BodyState<S>> {
        self.moved(&self.combined(weights))
    }

    /// For each free body, joint and contact with bristles, the step's length times the sum of the slopes with `weights`.
    pub(super) fn combined(&self, weights: &[f64]) -> Vec<Change<S>> {
        let mut sums = vec![[Vector3::zeros(); 4]; self.moving];
        self.add_combined(weights, &mut sums);
        sums
    }

    #[inline]
    fn add_combined(&self, weights: &[f64], sums: &mut [Change<S>]) {
        if self.moving == 0 {
            return;
        }
        for (slopes, weight) in self.slopes.chunks_exact(self.moving).zip(weights) {
            if *weight == 0.0 {
                continue;
            }
            let weight = weight * self.step.dt;
            for (sum, slope) in sums.iter_mut().zip(slopes) {
                for (sum, slope) in sum.iter_mut().zip(slope) {
                    sum.x += slope.x.times(weight);
                    sum.y += slope.y.times(weight);
                    sum.z += slope.z.times(weight);
                }
            }
        }
    }

    /// The states after `change`.
    fn moved(&self, change: &[Change<S>]) -> Vec<BodyState<S>> {
        let mut moved = self.states.to_vec();
        for (free, [position, velocity, turn, momentum]) in self.free.iter().zip(change) {
            let state = &mut moved[free.id];
            state.pose.translation.vector += position;
            state.linear += velocity;
            state.pose.rotation = turned(&state.pose.rotation, turn);
            state.angular = free.rigid.angular(&state.pose.rotation, &(free.momentum + momentum));
        }
        let (joints, deflections) = change[self.free.len()..].split_at(self.model.joint_count());
        for (place, [position, velocity, turn, spin]) in self.model.joint_places().zip(joints) {
            let state = &mut moved[place];
            state.pose.translation.vector += position;
            state.linear += velocity;
            state.pose.rotation = turned(&state.pose.rotation, turn);
            state.angular += spin;
        }
        let states = moved.iter_mut().skip(self.model.joint_places().end);
        for (state, [linear, angular, ..]) in states.zip(deflections) {
            *state = state.deflected(&spatial(linear, angular));
        }
        moved
    }

    /// The rates of change at `states` under `wrenches`, where the last change has led to.
    fn add_slopes(&mut self, states: &Rows<S>, wrenches: &[Vector6<S>]) {
        for (free, change) in self.free.iter().zip(&self.change) {
            let (state, turn, wrench) = (&states[free.id], &change[2], &wrenches[free.id]);
            let (force, torque) = (wrench.fixed_rows::<3>(0), wrench.fixed_rows::<3>(3));
            let turning = turn_rate(turn, &state.angular);
            let acceleration = self.model.gravity + force * (S::one() / free.rigid.mass());
            self.slopes.push([state.linear, acceleration, turning, torque.into_owned()]);
        }
        let joints = self.model.joint_places();
        let deflections = self.moving - self.free.len() - joints.len();
        let changes = &self.change[self.free.len()..];
        for ((place, joint), change) in joints.clone().zip(self.model.joints()).zip(changes) {
            let (state, turn, rate) = (&states[place], &change[2], &wrenches[place]);
            let [position, angular] = joint.rate_of_pose(state);
            let turning = if joint.turns() { turn_rate(turn, &angular) } else { Vector3::zeros() };
            let (linear, spin) = (rate.fixed_rows::<3>(0), rate.fixed_rows::<3>(3));
            self.slopes.push([position, linear.into_owned(), turning, spin.into_owned()]);
        }
        for rate in wrenches[joints.end..].iter().take(deflections) {
            let (linear, angular) = (rate.fixed_rows::<3>(0), rate.fixed_rows::<3>(3));
            let none = Vector3::zeros();
            self.slopes.push([linear.into_owned(), angular.into_owned(), none, none]);
        }
    }
}

/// The rate of the rotation vector `turn` whose body turns with `angular`.
fn turn_rate<S: Scalar>(turn: &Vector3<S>, angular: &Vector3<S>) -> Vector3<S> {
    let [(a, b, c), (d, e, f)] = [turn, angular].map(|v| (v.x, v.y, v.z));
    S::local(&TurnRate, [a, b, c, d, e, f]).into()
}

/// The rate of a rotation vector θ whose body turns with ω, of both.
struct TurnRate;

impl LocalFunction<6, 3> for TurnRate {
    #[inline]
    fn evaluate<S: Scalar>(&self, [a, b, c, d, e, f]: [S; 6]) -> [S; 3] {
        let (turn, angular) = (Vector3::new(a, b, c), Vector3::new(d, e, f));
        let once = turn.cross(&angular);
        let twice = turn.cross(&once);
        (angular - once.map(|x| x.times(0.5)) + twice.map(|x| x.times(1.0 / 12.0))).into()
    }

    #[inline]
    fn linearize(&self, x: [f64; 6]) -> Option<([f64; 3], [[f64; 6]; 3])> {
        let [by_turn, by_angular] = {
            let (turn, angular) = (Vector3::new(x[0], x[1], x[2]), Vector3::new(x[3], x[4], x[5]));
            let [turns, spins] = [turn, angular].map(|v| cross_matrix(&v));
            let twice = cross_matrix(&turn.cross(&angular)) + turns * spins;
            let identity = Matrix3::identity();
            [spins * 0.5 - twice / 12.0, identity - turns * 0.5 + turns * turns / 12.0]
        };
        let row = |i: usize| {
            let entry = |j: usize| if j < 3 { by_turn[(i, j)] } else { by_angular[(i, j - 3)] };
            std::array::from_fn(entry)
        };
        Some((self.evaluate(x), std::array::from_fn(row)))
    }
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::Fwd;

    use super::*;

    #[test]
    fn the_rate_of_a_rotation_vector_has_its_derivatives() {
        for x in [[0.3, -0.2, 0.5, 2.0, 1.0, -3.0], [0.0, 0.0, 0.0, 2.0, 1.0, -3.0], [0.0; 6]] {
            let (values, jacobian) = TurnRate.linearize(x).unwrap();
            let forward = TurnRate.evaluate(Fwd::<6>::variables(x));
            for ((value, row), forward) in values.iter().zip(jacobian).zip(forward) {
                assert_eq!(*value, forward.value);
                let off = row.iter().zip(forward.derivative).map(|(a, b)| (a - b).abs());
                assert!(off.fold(0.0, f64::max) < 1e-14);
            }
        }
    }
}
