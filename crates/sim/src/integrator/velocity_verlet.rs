//! Velocity Verlet: half a kick, a drift, half a kick.

use nalgebra::{Isometry3, Vector6};
use prehend_autodiff::Scalar;
use prehend_autodiff::rigid::turned;

use super::Integrator;
use crate::body::RigidBody;
use crate::error::SimulationError;
use crate::state::State;
use crate::time::Step;
use crate::world::World;

/// Velocity Verlet, second order, two evaluations of the forces a step.
///
/// Symplectic and reversible where forces do not depend on velocity. Where they do (damping, friction) the second kick
/// takes them at velocities predicted with the first, which keeps the second order (W. C. Swope et al., "A computer
/// simulation method for the calculation of equilibrium constants", J. Chem. Phys. 76, 1982; the prediction as in
/// R. D. Groot and P. B. Warren, J. Chem. Phys. 107, 1997, with λ = 1).
///
/// Rotations drift by the midpoint rule on SO(3), R' = exp(dt ω) R with ω = I(exp(dt ω/2) R)⁻¹ L and the angular
/// momentum L of half a kick (P. Krysl and L. Endres, "Explicit Newmark/Verlet algorithm for time integration of the
/// rotational dynamics of rigid bodies", IJNME 62, 2005). Its equation is solved by a fixed number of substitutions,
/// so that derivatives are those of what is computed. Angular momentum is conserved to rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VelocityVerlet;

/// Each substitution gains an order in dt |ω|.
const SUBSTITUTIONS: usize = 4;

impl Integrator for VelocityVerlet {
    fn step<S: Scalar>(
        &self,
        world: &World<S>,
        states: &[State<S>],
        step: Step,
    ) -> Result<Vec<State<S>>, SimulationError> {
        world.refuse_joints("VelocityVerlet")?;
        let dt = S::constant(step.dt);
        let before = world.wrenches(states, step.index);
        let mut next = states.to_vec();
        for ((body, state), wrench) in world.bodies.iter().zip(&mut next).zip(&before) {
            if let Some(rigid) = body.rigid() {
                let pose = drifted(rigid, world, state, wrench, dt);
                *state = kicked(rigid, world, state, pose, wrench, dt);
            }
        }
        world.deflect(&mut next, &before, dt);
        world.drive(&mut next, step.end());
        let after = world.wrenches(&next, step.index);
        let change = |(before, after)| (after - before) * dt.times(0.5);
        for (state, pair) in next.iter_mut().zip(before.iter().zip(&after)).skip(world.bodies.len())
        {
            *state = state.deflected(&change(pair));
        }
        let bodies = world.bodies.iter().zip(states).zip(before.iter().zip(&after));
        for (((body, state), (before, after)), next) in bodies.zip(&mut next) {
            if let Some(rigid) = body.rigid() {
                let mean = (before + after) * S::constant(0.5);
                *next = kicked(rigid, world, state, next.pose, &mean, dt);
            }
        }
        Ok(next)
    }

    /// 2 without damping, 1.73 at the worst damping rate, which is 0.63 ω.
    fn stability_limit(&self) -> f64 {
        1.73
    }
}

/// Where `state` is after `dt`, with the velocities of half a kick.
fn drifted<S: Scalar>(
    body: &RigidBody<S>,
    world: &World<S>,
    state: &State<S>,
    wrench: &Vector6<S>,
    dt: S,
) -> Isometry3<S> {
    let half = dt.times(0.5);
    let mid = kicked(body, world, state, state.pose, wrench, half);
    let rotation = &state.pose.rotation;
    let momentum = body.momentum(rotation, &mid.angular);
    let mut angular = mid.angular;
    for _ in 0..SUBSTITUTIONS {
        angular = body.angular(&turned(rotation, &(angular * half)), &momentum);
    }
    let mut pose = state.pose;
    pose.translation.vector += mid.linear * dt;
    pose.rotation = turned(rotation, &(angular * dt));
    pose
}

/// `state` brought to `pose`, with the momenta that `wrench` and gravity give it in `dt`.
#[inline]
fn kicked<S: Scalar>(
    body: &RigidBody<S>,
    world: &World<S>,
    state: &State<S>,
    pose: Isometry3<S>,
    wrench: &Vector6<S>,
    dt: S,
) -> State<S> {
    let (linear, momentum) = body.kicked(state, wrench, &world.gravity, dt);
    State { pose, linear, angular: body.angular(&pose.rotation, &momentum) }
}
