//! Backward Euler: forces at the end of the step.

use nalgebra::{DMatrix, DVector, Vector6};
use prehend_autodiff::lie::so3_exp;
use prehend_autodiff::{Fwd, LocalFunction, Scalar};

use super::Integrator;
use crate::body::RigidBody;
use crate::error::SimulationError;
use crate::state::State;
use crate::world::{Step, World};

/// Backward Euler, first order, stable for every step: what is faster than the step is damped away.
///
/// v' = v + dt (g + f'/m), L' = L + dt τ', with the forces at the end of the step, x' = x + dt v',
/// R' = exp(dt ω') R, L' = I(R')ω'. Newton's method finds the velocities of all free bodies together, with the exact
/// Jacobian of the contacts and steps that are shortened until the residual, in the norm of kinetic energy, falls. The
/// derivative of a step is that of the solution, by the implicit function theorem (D. Baraff, A. Witkin, "Large steps in
/// cloth simulation", 1998; E. Hairer, G. Wanner, "Solving ordinary differential equations II", IV.8).
///
/// # Errors
/// A force that jumps, as a damped contact does under a hard onset, may leave the equations of an impact without a
/// solution: [`SimulationError::Unsolved`]. [`SubStepped`](super::SubStepped) then tries shorter steps; a softplus
/// onset has no jumps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BackwardEuler;

const MOST_ITERATIONS: usize = 60;

/// Shortest fraction of a Newton step.
const SHORTEST: f64 = 1e-6;

/// A Newton step so short, absolute \[m/s, rad/s\] and relative, is the last: convergence is quadratic, so that what is
/// left after it is rounding.
const LAST: (f64, f64) = (1e-10, 1e-9);

impl Integrator for BackwardEuler {
    fn step<S: Scalar>(
        &self,
        world: &World<S>,
        states: &[State<S>],
        step: Step,
    ) -> Result<Vec<State<S>>, SimulationError> {
        let free: Vec<usize> =
            (0..world.bodies.len()).filter(|&i| world.bodies[i].rigid().is_some()).collect();
        let values: Vec<State> = states.iter().map(State::value).collect();
        let plain = world.plain();
        let lifted = plain.lift();
        let mut at_end = values.clone();
        plain.drive(&mut at_end, step.after().time());
        let mut equations =
            Equations { world: &plain, lifted: &lifted, states: &values, at_end, free, step };
        let solution = equations.solve()?;
        if S::ORDER == 0 {
            return Ok(carried(world, states, &equations, &solution, &DMatrix::zeros(0, 0)));
        }
        // Onsets that leak do so in derivatives only.
        let mut leaky = lifted.clone();
        for (leaky, pair) in leaky.contacts.iter_mut().zip(&world.contacts) {
            leaky.onset = pair.onset;
        }
        equations.lifted = &leaky;
        let inverse = equations.linearise(&solution).1.try_inverse();
        let inverse = inverse.ok_or_else(|| equations.unsolved(&solution, 0))?;
        Ok(carried(world, states, &equations, &solution, &inverse))
    }

    fn stability_limit(&self) -> f64 {
        f64::INFINITY
    }
}

/// The states at the end, with the derivatives of the solution: x − J⁻¹F(x), where F carries those by all else.
fn carried<S: Scalar>(
    world: &World<S>,
    states: &[State<S>],
    equations: &Equations<'_>,
    solution: &DVector<f64>,
    inverse: &DMatrix<f64>,
) -> Vec<State<S>> {
    let (free, dt) = (&equations.free, equations.step.dt);
    let mut next = states.to_vec();
    world.drive(&mut next, equations.step.after().time());
    let velocity =
        |slot: usize| -> [S; 6] { std::array::from_fn(|i| S::constant(solution[6 * slot + i])) };
    for (slot, &body) in free.iter().enumerate() {
        next[body] = arrived(&states[body], &velocity(slot), dt);
    }
    if S::ORDER == 0 {
        return next;
    }
    let wrenches = world.wrenches(&next, equations.step.index);
    let excess: Vec<[S; 6]> = (free.iter().enumerate())
        .filter_map(|(slot, &body)| {
            let rigid = world.bodies[body].rigid()?;
            Some(excess(rigid, world, &states[body], &velocity(slot), &wrenches[body], dt))
        })
        .collect();
    for (row, &body) in free.iter().enumerate() {
        let mut velocity = velocity(row);
        for (column, excess) in excess.iter().enumerate() {
            let block = inverse.fixed_view::<6, 6>(6 * row, 6 * column);
            let rows = Rows(std::array::from_fn(|i| std::array::from_fn(|j| block[(i, j)])));
            for (velocity, change) in velocity.iter_mut().zip(S::local(&rows, *excess)) {
                *velocity -= change;
            }
        }
        next[body] = arrived(&states[body], &velocity, dt);
    }
    next
}

/// A matrix that multiplies.
struct Rows([[f64; 6]; 6]);

impl LocalFunction<6, 6> for Rows {
    fn evaluate<S: Scalar>(&self, x: [S; 6]) -> [S; 6] {
        self.0.map(|row| row.iter().zip(x).fold(S::zero(), |sum, (a, x)| sum + x.times(*a)))
    }
}

/// `state` after moving with `velocity` (linear, angular) for `dt`.
fn arrived<S: Scalar>(state: &State<S>, velocity: &[S; 6], dt: f64) -> State<S> {
    let [x, y, z, rx, ry, rz] = *velocity;
    let moving = State { linear: [x, y, z].into(), angular: [rx, ry, rz].into(), ..*state };
    moving.drifted(dt)
}

/// `velocity` at the end of the step less what momentum and `wrench` there make it.
fn excess<S: Scalar>(
    body: &RigidBody<S>,
    world: &World<S>,
    state: &State<S>,
    velocity: &[S; 6],
    wrench: &Vector6<S>,
    dt: f64,
) -> [S; 6] {
    let [vx, vy, vz, wx, wy, wz] = *velocity;
    let (force, torque) = (wrench.fixed_rows::<3>(0), wrench.fixed_rows::<3>(3));
    let step = S::constant(dt);
    let linear = state.linear + (world.gravity + force / body.mass()) * step;
    let rotation = &state.pose.rotation;
    let momentum = body.world_inertia(rotation) * state.angular + torque * step;
    let turned = so3_exp(&nalgebra::Vector3::new(wx, wy, wz).map(|w| w.times(dt))) * rotation;
    let angular = body.inverse_world_inertia(&turned) * momentum;
    let expected = [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z];
    let velocity = [vx, vy, vz, wx, wy, wz];
    std::array::from_fn(|i| velocity[i] - expected[i])
}

/// The equations of a step, for the velocities of the free bodies, one after the other.
struct Equations<'a> {
    world: &'a World,
    lifted: &'a World<Fwd<12>>,
    states: &'a [State],
    /// The states at the end, right for the bodies that are not free.
    at_end: Vec<State>,
    free: Vec<usize>,
    step: Step,
}

impl Equations<'_> {
    /// Newton's method: first from the velocities at the start, then from those of a flight without contacts, in
    /// which what will touch touches already.
    fn solve(&self) -> Result<DVector<f64>, SimulationError> {
        let start = |flight: f64| {
            let velocity = |&body: &usize| {
                let State { linear, angular, .. } = self.states[body];
                let linear = linear + self.world.gravity * flight;
                [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
            };
            DVector::from_vec(self.free.iter().flat_map(velocity).collect())
        };
        match self.newton(start(0.0)) {
            Err(SimulationError::Unsolved { .. }) => self.newton(start(self.step.dt)),
            solved => solved,
        }
    }

    fn newton(&self, mut x: DVector<f64>) -> Result<DVector<f64>, SimulationError> {
        for iteration in 1..=MOST_ITERATIONS {
            let (residual, jacobian) = self.linearise(&x);
            let tolerance = LAST.0 + LAST.1 * x.amax();
            let Some(change) = jacobian.lu().solve(&-&residual) else {
                return Err(self.unsolved(&x, iteration));
            };
            if change.iter().all(|c| c.abs() <= tolerance) {
                return Ok(x + change);
            }
            let size = self.norm(&residual);
            let falls = |fraction: &f64| {
                let next = self.norm(&self.residual(&(&x + &change * *fraction)));
                next <= (1.0 - 1e-4 * fraction) * size
            };
            let mut fractions = std::iter::successors(Some(1.0), |fraction| Some(0.5 * fraction))
                .take_while(|fraction| *fraction >= SHORTEST);
            let Some(fraction) = fractions.find(falls) else {
                return Err(self.unsolved(&x, iteration));
            };
            x += change * fraction;
        }
        Err(self.unsolved(&x, MOST_ITERATIONS))
    }

    fn residual(&self, x: &DVector<f64>) -> DVector<f64> {
        let wrenches = self.world.wrenches(&self.ends(x), self.step.index);
        self.excesses(x, &wrenches)
    }

    fn excesses(&self, x: &DVector<f64>, wrenches: &[Vector6<f64>]) -> DVector<f64> {
        let mut excesses = DVector::zeros(x.len());
        for (slot, &body) in self.free.iter().enumerate() {
            let Some(rigid) = self.world.bodies[body].rigid() else { continue };
            let (state, velocity) = (&self.states[body], velocity_at(x, slot));
            let excess = excess(rigid, self.world, state, &velocity, &wrenches[body], self.step.dt);
            excesses.fixed_rows_mut::<6>(6 * slot).copy_from_slice(&excess);
        }
        excesses
    }

    fn ends(&self, x: &DVector<f64>) -> Vec<State> {
        let mut ends = self.at_end.clone();
        for (slot, &body) in self.free.iter().enumerate() {
            ends[body] = arrived(&self.states[body], &velocity_at(x, slot), self.step.dt);
        }
        ends
    }

    /// The residual and its Jacobian.
    fn linearise(&self, x: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let dt = self.step.dt;
        let ends = self.ends(x);
        let mut slots = vec![None; ends.len()];
        self.free.iter().enumerate().for_each(|(slot, &body)| slots[body] = Some(slot));
        let mut wrenches: Vec<Vector6<f64>> =
            self.world.bodies.iter().map(|body| body.load).collect();
        let mut by_velocity = DMatrix::zeros(x.len(), x.len());
        let mut states: Vec<State<Fwd<12>>> = ends.iter().map(State::lift).collect();
        for pair in &self.lifted.contacts {
            // The velocities of the one body in lanes 0..6, of the other in lanes 6..12.
            let bodies = [pair.samples, pair.field];
            for (body, lane) in bodies.into_iter().zip([0, 6]) {
                if let Some(slot) = slots[body] {
                    let at = velocity_at(x, slot);
                    let velocity = std::array::from_fn(|i| Fwd::variable(at[i], lane + i));
                    states[body] = arrived(&self.states[body].lift(), &velocity, dt);
                }
            }
            let pair_wrenches = self.lifted.contact_wrenches(pair, &states, self.step.index);
            for (on, wrench) in bodies.into_iter().zip(pair_wrenches) {
                wrenches[on] += wrench.map(|w| w.value);
                let Some(row) = slots[on] else { continue };
                for (body, lane) in bodies.into_iter().zip([0, 6]) {
                    let Some(column) = slots[body] else { continue };
                    for (i, component) in wrench.iter().enumerate() {
                        for j in 0..6 {
                            by_velocity[(6 * row + i, 6 * column + j)] +=
                                component.derivative[lane + j];
                        }
                    }
                }
            }
            bodies.into_iter().for_each(|body| states[body] = ends[body].lift());
        }
        (self.excesses(x, &wrenches), self.jacobian(x, &wrenches, &by_velocity))
    }

    /// Derivative of the excesses, with that of the wrenches.
    fn jacobian(
        &self,
        x: &DVector<f64>,
        wrenches: &[Vector6<f64>],
        wrenches_by_velocity: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(x.len(), x.len());
        for (slot, &body) in self.free.iter().enumerate() {
            let Some(rigid) = self.lifted.bodies[body].rigid() else { continue };
            // The body's own velocity in lanes 0..6, the wrench on it in lanes 6..12.
            let at = velocity_at(x, slot);
            let velocity = std::array::from_fn(|i| Fwd::variable(at[i], i));
            let wrench = Vector6::from_fn(|i, _| Fwd::variable(wrenches[body][i], 6 + i));
            let state = self.states[body].lift();
            let excess = excess(rigid, self.lifted, &state, &velocity, &wrench, self.step.dt);
            let by =
                |lane: usize| nalgebra::Matrix6::from_fn(|i, j| excess[i].derivative[lane + j]);
            let mut rows = jacobian.fixed_rows_mut::<6>(6 * slot);
            rows.copy_from(&(by(6) * wrenches_by_velocity.fixed_rows::<6>(6 * slot)));
            let mut own = rows.fixed_columns_mut::<6>(6 * slot);
            own += by(0);
        }
        jacobian
    }

    /// The velocity of equal kinetic energy of 1 kg \[m/s\].
    fn norm(&self, velocities: &DVector<f64>) -> f64 {
        let energy = |(slot, &body): (usize, &usize)| {
            let rigid = self.world.bodies[body].rigid()?;
            let at = Vector6::from(velocity_at(velocities, slot));
            let (linear, angular) = (at.fixed_rows::<3>(0), at.fixed_rows::<3>(3));
            let inertia = rigid.world_inertia(&self.states[body].pose.rotation);
            Some(rigid.mass() * linear.norm_squared() + angular.dot(&(inertia * angular)))
        };
        self.free.iter().enumerate().filter_map(energy).sum::<f64>().sqrt()
    }

    fn unsolved(&self, x: &DVector<f64>, iterations: usize) -> SimulationError {
        let (step, time) = (self.step.index, self.step.time());
        SimulationError::Unsolved { step, time, residual: self.residual(x).norm(), iterations }
    }
}

fn velocity_at(x: &DVector<f64>, slot: usize) -> [f64; 6] {
    std::array::from_fn(|i| x[6 * slot + i])
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use prehend_autodiff::check::{compare_gradients, finite_difference_jacobian};

    use super::*;
    use crate::scenes::{bowl, egg_on};
    use crate::{Horizon, LeakSteps, Motion, Onset};

    /// The egg in a bowl that flies freely.
    fn egg_in_free_bowl(onset: Onset) -> (World, Vec<State>) {
        let (mut world, mut states) = egg_on(bowl(), onset);
        let mut rigid = *world.bodies[1].rigid().unwrap();
        rigid = RigidBody::new(0.5, rigid.inertia() * 3.0, *rigid.com()).unwrap();
        world.bodies[0].motion = Motion::Free(rigid);
        states[0] = rigid.at_rest(&nalgebra::Isometry3::identity());
        states[0].angular = Vector3::new(-0.5, 0.3, 0.2);
        states[1].pose.translation.z -= 5e-4;
        (world, states)
    }

    #[test]
    fn free_bodies_are_solved_and_differentiated_together() {
        let (world, states) = egg_in_free_bowl(Onset::Softplus { width: 3e-4 });
        let horizon = Horizon { dt: 2e-3, steps: 3 };
        for moving in 0..2 {
            let mut lifted: Vec<State<Fwd<12>>> = states.iter().map(State::lift).collect();
            lifted[moving] = states[moving].variables();
            let run = world.lift().simulate(&BackwardEuler, &lifted, horizon, |_, _| ()).unwrap();
            let differences = finite_difference_jacobian(
                |x| {
                    let mut moved = states.clone();
                    let tangent = std::array::from_fn::<f64, 12, _>(|i| x[i]);
                    moved[moving] = states[moving].moved(&tangent);
                    let run = world.simulate(&BackwardEuler, &moved, horizon, |_, _| ()).unwrap();
                    let velocities = run.iter().flat_map(|s| [s.linear, s.angular]);
                    velocities.flat_map(|v| [v.x, v.y, v.z]).collect()
                },
                &[0.0; 12],
                1e-6,
            );
            let exact = run.iter().flat_map(|s| [s.linear, s.angular]);
            for (exact, reference) in exact.flat_map(|v| [v.x, v.y, v.z]).zip(&differences) {
                let error = compare_gradients(&exact.derivative, reference);
                assert!(error.relative < 1e-6, "body {moving}: {error:?}");
            }
        }
        let plain = world.simulate(&BackwardEuler, &states, horizon, |_, _| ()).unwrap();
        let momentum = |states: &[State]| states[0].linear * 0.5 + states[1].linear * 0.2;
        let gained = world.gravity * (0.7 * 6e-3);
        assert!((momentum(&plain) - momentum(&states) - gained).norm() < 1e-14);
    }

    #[test]
    fn steps_far_beyond_the_stability_limit_come_to_rest() {
        let (mut world, states) = egg_on(bowl(), Onset::Softplus { width: 3e-4 });
        world.contacts[0].params[0] *= 1e3;
        let mut hit = states.clone();
        hit[1].pose.translation.z -= 1e-3;
        assert!(0.01 * world.contact_frequency(&hit) > 50.0);
        let horizon = Horizon { dt: 0.01, steps: 300 };
        let end = world.simulate(&BackwardEuler, &states, horizon, |_, _| ()).unwrap()[1];
        assert!(end.linear.norm() < 1e-3 && end.angular.norm() < 0.1, "{end:?}");
    }

    #[test]
    fn leaks_matter_to_derivatives_only() {
        let leaky = Onset::Leaky { alpha: 0.1, band: 1e-2, steps: LeakSteps::All };
        let ends = [Onset::Hard, leaky].map(|onset| {
            let (world, mut states) = egg_on(bowl(), onset);
            states[1].pose.translation.z += 5e-3;
            let lifted = [states[0].lift(), states[1].variables()];
            let step = Step { index: 0, dt: 1e-3 };
            BackwardEuler.step(&world.lift(), &lifted, step).unwrap()[1]
        });
        assert_eq!(ends[0].value(), ends[1].value());
        let slope = |end: &State<Fwd<12>>| end.linear.z.derivative[2];
        assert_eq!(slope(&ends[0]), 0.0);
        assert!(slope(&ends[1]) < -1e-2, "{}", slope(&ends[1]));
    }

    #[test]
    fn a_jump_without_a_solution_is_an_error() {
        let (world, states, step) = crate::integrator::tests::jump();
        let error = BackwardEuler.step(&world, &states, step).unwrap_err();
        let SimulationError::Unsolved { step: 3, time, residual, iterations } = error else {
            panic!("{error}");
        };
        assert!((time - 0.03).abs() < 1e-15 && residual > 1e-3 && iterations > 0);
        assert!(error.to_string().contains("step 3"));
    }
}
