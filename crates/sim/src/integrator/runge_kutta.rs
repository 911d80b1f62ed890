//! The classic Runge–Kutta method, on the manifold of poses.

use nalgebra::Vector3;
use prehend_autodiff::Scalar;
use prehend_autodiff::lie::so3_exp;

use super::Integrator;
use crate::error::SimulationError;
use crate::state::State;
use crate::time::Step;
use crate::world::World;

/// The classic Runge–Kutta method, fourth order on smooth forces, four evaluations of them a step.
///
/// Rotations are R = exp(θ) R₀ with the rotation vector θ from the start of the step, whose rate is
/// dexp⁻¹(θ) ω = ω − θ×ω/2 + θ×(θ×ω)/12 to the order that counts (H. Munthe-Kaas, "High order Runge–Kutta methods on
/// manifolds", Appl. Numer. Math. 29, 1999). Angular momentum L = I(R)ω is what is integrated, so it is conserved to
/// rounding. Driven bodies are where they are at each stage. Forces with kinks, such as those of unsmoothed gaps, cost the order
/// in the steps that cross them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RungeKutta4;

/// Of a body: position of the center of mass, its velocity, rotation vector, and angular momentum; or their rates.
type Change<S> = [Vector3<S>; 4];

impl Integrator for RungeKutta4 {
    fn step<S: Scalar>(
        &self,
        world: &World<S>,
        states: &[State<S>],
        step: Step,
    ) -> Result<Vec<State<S>>, SimulationError> {
        let none = vec![[Vector3::zeros(); 4]; states.len()];
        let mut slope = rates(world, states, &none, step.index);
        let mut sum = slope.clone();
        for (fraction, weight) in [(0.5, 2.0), (0.5, 2.0), (1.0, 1.0)] {
            let change = scaled(&slope, fraction * step.dt);
            let mut stage = moved(world, states, &change);
            world.drive(&mut stage, step.time() + fraction * step.dt);
            slope = rates(world, &stage, &change, step.index);
            for (sum, term) in sum.iter_mut().flatten().zip(scaled(&slope, weight).iter().flatten())
            {
                *sum += term;
            }
        }
        Ok(moved(world, states, &scaled(&sum, step.dt / 6.0)))
    }

    /// The left half of the disc of radius 2.6 is inside the stability region, which ends at 2.83 on the imaginary axis.
    fn stability_limit(&self) -> f64 {
        2.6
    }
}

fn scaled<S: Scalar>(rates: &[Change<S>], factor: f64) -> Vec<Change<S>> {
    rates.iter().map(|rate| rate.map(|r| r.map(|x| x.times(factor)))).collect()
}

/// The rates of change at `states`, which `change` has led to.
fn rates<S: Scalar>(
    world: &World<S>,
    states: &[State<S>],
    change: &[Change<S>],
    index: usize,
) -> Vec<Change<S>> {
    let wrenches = world.wrenches(states, index);
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
