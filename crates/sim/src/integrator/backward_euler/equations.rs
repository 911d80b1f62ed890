//! The equations of an implicit step.

use std::collections::BTreeMap;

use nalgebra::{DVector, Matrix6, Vector3, Vector6};
use prehend_autodiff::implicit::{Equations, ImplicitError, newton};
use prehend_autodiff::rigid::turned;
use prehend_autodiff::solve::{Factored, SolveError, sparse_lu};
use prehend_autodiff::{Fwd, Scalar};

use crate::body::RigidBody;
use crate::body_state::{BodyState, Rows};
use crate::error::{Result, SimulationError};
use crate::handle::BodyId;
use crate::model::Model;
use crate::model::pair_jacobian::PairJacobian;
use crate::time::Step;

/// `state` after moving with `velocity` (linear, angular) for `dt`.
pub(super) fn arrived<S: Scalar>(state: &BodyState<S>, velocity: &[S; 6], dt: f64) -> BodyState<S> {
    let [x, y, z, rx, ry, rz] = *velocity;
    let moving = BodyState { linear: [x, y, z].into(), angular: [rx, ry, rz].into(), ..*state };
    moving.drifted(dt)
}

/// `velocity` at the end of the step less what momentum and `wrench` there make it.
pub(super) fn excess<S: Scalar>(
    body: &RigidBody<S>,
    gravity: &Vector3<S>,
    state: &BodyState<S>,
    velocity: &[S; 6],
    wrench: &Vector6<S>,
    dt: f64,
) -> [S; 6] {
    let [vx, vy, vz, wx, wy, wz] = *velocity;
    let (linear, momentum) = body.apply_impulse(state, wrench, gravity, S::constant(dt));
    let rotation = turned(&state.pose.rotation, &Vector3::new(wx, wy, wz).map(|w| w.times(dt)));
    let angular = body.angular(&rotation, &momentum);
    let expected = [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z];
    let velocity = [vx, vy, vz, wx, wy, wz];
    std::array::from_fn(|i| velocity[i] - expected[i])
}

/// The equations of a step, for the velocities of the free bodies, one after the other.
pub(super) struct ImplicitStep<'a> {
    pub(super) model: &'a Model,
    /// The model with the contacts that count in derivatives.
    pub(super) leaky: &'a Model,
    pub(super) states: &'a Rows,
    /// The states at the end, right for the bodies that are not free.
    pub(super) at_end: Vec<BodyState>,
    pub(super) free: Vec<BodyId>,
    pub(super) step: Step,
}

/// Derivatives of the wrenches on free bodies by their velocities, where there are any.
type Blocks = BTreeMap<(usize, usize), Matrix6<f64>>;

impl ImplicitStep<'_> {
    /// Newton's method: first from the velocities at the start, then from those of a flight without contacts, in
    /// which what will touch touches already.
    pub(super) fn solve(&self) -> Result<DVector<f64>> {
        let start = |flight: f64| {
            let velocity = |&body: &BodyId| {
                let BodyState { linear, angular, .. } = self.states[body];
                let linear = linear + self.model.gravity * flight;
                [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
            };
            DVector::from_vec(self.free.iter().flat_map(velocity).collect())
        };
        let solved = newton(self, start(0.0)).or_else(|_| newton(self, start(self.step.dt)));
        solved.map_err(|error| match error {
            ImplicitError::NotConverged { iterations, residual, .. } => {
                self.unsolved(residual, iterations)
            }
            _ => self.unsolved(self.residual(&start(0.0)).norm(), 0),
        })
    }

    fn excesses(&self, x: &DVector<f64>, wrenches: &[Vector6<f64>]) -> DVector<f64> {
        let mut excesses = DVector::zeros(x.len());
        for (slot, &body) in self.free.iter().enumerate() {
            let Some(rigid) = self.model.bodies[body].rigid() else { continue };
            let (state, velocity) = (&self.states[body], velocity_at(x, slot));
            let gravity = &self.model.gravity;
            let excess = excess(rigid, gravity, state, &velocity, &wrenches[body], self.step.dt);
            excesses.fixed_rows_mut::<6>(6 * slot).copy_from_slice(&excess);
        }
        excesses
    }

    fn ends(&self, x: &DVector<f64>) -> Vec<BodyState> {
        let mut ends = self.at_end.clone();
        for (slot, &body) in self.free.iter().enumerate() {
            ends[body] = arrived(&self.states[body], &velocity_at(x, slot), self.step.dt);
        }
        ends
    }

    /// Derivative of the excesses, with that of the wrenches, by blocks.
    fn jacobian(
        &self,
        x: &DVector<f64>,
        wrenches: &[Vector6<f64>],
        wrenches_by_velocity: &Blocks,
    ) -> Result<Factored, SolveError> {
        let mut entries = Vec::new();
        let mut write = |row: usize, column: usize, block: Matrix6<f64>| {
            let place = |i: usize, j: usize| (6 * row + i, 6 * column + j, block[(i, j)]);
            entries.extend((0..36).map(|k| place(k % 6, k / 6)));
        };
        for (slot, &body) in self.free.iter().enumerate() {
            let Some(rigid) = self.model.bodies[body].rigid() else { continue };
            // The body's own velocity in lanes 0..6, the wrench on it in lanes 6..12.
            let at = velocity_at(x, slot);
            let velocity = std::array::from_fn(|i| Fwd::<12>::variable(at[i], i));
            let wrench = Vector6::from_fn(|i, _| Fwd::variable(wrenches[body][i], 6 + i));
            let state = self.states[body].cast();
            let (rigid, gravity) =
                (rigid.map(Fwd::constant), self.model.gravity.map(Fwd::constant));
            let excess = excess(&rigid, &gravity, &state, &velocity, &wrench, self.step.dt);
            let by = |lane: usize| Matrix6::from_fn(|i, j| excess[i].derivative[lane + j]);
            write(slot, slot, by(0));
            let by_wrench = by(6);
            for ((_, column), block) in wrenches_by_velocity.range((slot, 0)..(slot + 1, 0)) {
                write(slot, *column, by_wrench * block);
            }
        }
        sparse_lu(x.len(), &entries)
    }

    pub(super) fn unsolved(&self, residual: f64, iterations: usize) -> SimulationError {
        let (step, time) = (self.step.index, self.step.start);
        let (body, contact) = self.model.most_accelerated(self.states);
        SimulationError::Unsolved { step, time, body, contact, residual, iterations }
    }
}

impl Equations for ImplicitStep<'_> {
    fn residual(&self, x: &DVector<f64>) -> DVector<f64> {
        let wrenches = self.model.wrenches_of(&self.ends(x), self.step.index);
        self.excesses(x, &wrenches)
    }

    fn linearize(&self, x: &DVector<f64>) -> Result<(DVector<f64>, Factored), ImplicitError> {
        let ends = self.ends(x);
        let mut slots = vec![None; ends.len()];
        for (slot, &body) in self.free.iter().enumerate() {
            let at = velocity_at(x, slot);
            let velocity = std::array::from_fn(|i| Fwd::<6>::variable(at[i], i));
            let moved = arrived(&self.states[body].cast(), &velocity, self.step.dt);
            slots[body] = Some((slot, moved.sensitivity()));
        }
        let mut wrenches: Vec<Vector6<f64>> =
            self.model.bodies.iter().map(|body| body.external_wrench).collect();
        let mut by_velocity = Blocks::new();
        for PairJacobian { bodies, on, by, .. } in self.leaky.pair_jacobians(&ends, self.step.index)
        {
            for ((body, on), by) in bodies.into_iter().zip(on).zip(by) {
                wrenches[body] += on;
                let Some((row, _)) = slots[body] else { continue };
                for (body, by) in bodies.into_iter().zip(by) {
                    let Some((column, moved)) = &slots[body] else { continue };
                    let block = by * moved;
                    if block != Matrix6::zeros() {
                        *by_velocity.entry((row, *column)).or_default() += block;
                    }
                }
            }
        }
        let jacobian = self.jacobian(x, &wrenches, &by_velocity)?;
        Ok((self.excesses(x, &wrenches), jacobian))
    }

    /// The velocity of equal kinetic energy of 1 kg \[m/s\].
    fn norm(&self, velocities: &DVector<f64>) -> Option<f64> {
        let energy = |(slot, &body): (usize, &BodyId)| {
            let rigid = self.model.bodies[body].rigid()?;
            let at = Vector6::from(velocity_at(velocities, slot));
            let (linear, angular) = (at.fixed_rows::<3>(0), at.fixed_rows::<3>(3));
            let rotation = &self.states[body].pose.rotation;
            let momentum = rigid.momentum(rotation, &angular.into_owned());
            Some(rigid.mass() * linear.norm_squared() + angular.dot(&momentum))
        };
        Some(self.free.iter().enumerate().filter_map(energy).sum::<f64>().sqrt())
    }

    /// By the fastest body \[m/s, rad/s\].
    fn error(&self, x: &DVector<f64>, step: &DVector<f64>) -> f64 {
        step.amax() / (1e-10 + 1e-9 * x.amax())
    }
}

pub(super) fn velocity_at(x: &DVector<f64>, slot: usize) -> [f64; 6] {
    std::array::from_fn(|i| x[6 * slot + i])
}
