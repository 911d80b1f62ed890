//! Semi-implicit (symplectic) Euler: momenta first, then positions with the new velocities.

use nalgebra::{Vector3, Vector6};
use prehend_autodiff::Scalar;
use prehend_autodiff::rigid::turned;

use super::Integrator;
use crate::body::RigidBody;
use crate::body_state::{BodyState, Rows};
use crate::error::Result;
use crate::model::Model;
use crate::state::State;
use crate::time::Step;

/// Semi-implicit Euler, first order: the standard for stiff penalty contact.
///
/// The rotational part is kept in momentum form, L = I(R)ω: L' = L + dt τ, R' = exp(dt I(R)⁻¹L') R,
/// ω' = I(R')⁻¹L'. The gyroscopic term thus comes from the turning inertia, and angular momentum is conserved to
/// rounding. Joints follow v' = v + dt v̇, q' = q + dt v'.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SemiImplicitEuler;

impl Integrator for SemiImplicitEuler {
    fn step<S: Scalar>(&self, model: &Model<S>, state: &State<S>, step: Step) -> Result<State<S>> {
        let (wrenches, dt) = (model.wrenches_of(state.rows(), step.index), S::constant(step.dt));
        let mut next = moved(model, state.rows(), &wrenches, dt);
        model.integrate_bristles(&mut next, &wrenches, dt);
        Ok(state.with(next, step.end()))
    }

    fn evaluates_forces_once(&self) -> bool {
        true
    }

    /// √5 − 1. An oscillator ẍ = −ω²x − c ẋ is multiplied each step by a matrix of trace 2 − dt c − (dt ω)² and determinant
    /// 1 − dt c, whose eigenvalues are inside the unit circle for (dt ω)² + 2 dt c < 4 (Jury's criterion). That is dt ω < 2
    /// without damping; for a given dt·max(ω, c) = s the worst is ω = c, with s² + 2s < 4.
    fn stability_limit(&self) -> f64 {
        1.236
    }
}

/// The states after `dt` \[s\] with these wrenches on bodies and accelerations of joints, before contacts with bristles are deflected.
pub(crate) fn moved<S: Scalar>(
    model: &Model<S>,
    states: &Rows<S>,
    wrenches: &[Vector6<S>],
    dt: S,
) -> Vec<BodyState<S>> {
    let bodies = model.bodies.iter().zip(states).zip(wrenches);
    let next = bodies.map(|((body, state), wrench)| match body.rigid() {
        Some(rigid) => advance(rigid, &model.gravity, state, wrench, dt),
        None => *state,
    });
    let mut next: Vec<BodyState<S>> = next.collect();
    next.extend_from_slice(&states[next.len()..]);
    model.integrate_joints(&mut next, wrenches, dt);
    next
}

/// A body's state after `dt` \[s\].
#[inline]
pub(crate) fn advance<S: Scalar>(
    body: &RigidBody<S>,
    gravity: &Vector3<S>,
    state: &BodyState<S>,
    wrench: &Vector6<S>,
    dt: S,
) -> BodyState<S> {
    let mut next = *state;
    let (linear, momentum) = body.apply_impulse(state, wrench, gravity, dt);
    next.linear = linear;
    next.pose.translation.vector += next.linear * dt;
    let rotation = &state.pose.rotation;
    let mid_velocity = body.angular(rotation, &momentum);
    next.pose.rotation = turned(rotation, &(mid_velocity * dt));
    next.angular = body.angular(&next.pose.rotation, &momentum);
    next
}
