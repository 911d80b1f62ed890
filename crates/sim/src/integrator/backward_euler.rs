//! Backward Euler: forces at the end of the step.

mod equations;

use equations::{ImplicitStep, arrived, excess, velocity_at};
use nalgebra::DVector;
use prehend_autodiff::Scalar;
use prehend_autodiff::implicit::Equations as _;
use prehend_autodiff::solve::Factored;

use super::Integrator;
use crate::body_state::{BodyState, Rows};
use crate::error::Result;
use crate::model::Model;
use crate::state::State;
use crate::time::Step;

/// Backward Euler, first order, stable for every step: what is faster than the step is damped away.
///
/// v' = v + dt (g + f'/m), L' = L + dt τ', with the forces at the end of the step, x' = x + dt v',
/// R' = exp(dt ω') R, L' = I(R')ω'. Newton's method finds the velocities of all free bodies together, with the exact
/// Jacobian of the contacts and steps that are shortened until the residual, in the norm of kinetic energy, falls. The
/// derivative of a step is that of the solution, by the implicit function theorem (D. Baraff, A. Witkin, "Large steps in
/// cloth simulation", 1998; E. Hairer, G. Wanner, "Solving ordinary differential equations II", IV.8).
///
/// With the cargo feature `faer` the equations of many bodies are solved as sparse ones.
///
/// The deflections of contacts with bristles ([`Bristles`](crate::contact::Bristles)) follow explicitly: steps should not be longer than u_b/(2
/// v_b), which is 1 ms for [`BristleFriction`](crate::BristleFriction) of 0.1 mm and a slip scale of 1 cm/s.
///
/// # Errors
/// A force that jumps, as that of a damped contact does without smoothing, may leave the equations of an impact without a
/// solution: [`SimulationError::Unsolved`](crate::SimulationError::Unsolved). [`SubStepped`](crate::integrator::SubStepped) then tries shorter steps; a softplus
/// has no jumps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BackwardEuler;

impl Integrator for BackwardEuler {
    fn step<S: Scalar>(&self, model: &Model<S>, state: &State<S>, step: Step) -> Result<State<S>> {
        model.ensure_no_joints("BackwardEuler")?;
        model.ensure_no_bushings("BackwardEuler")?;
        let free = model.free_bodies();
        if free.is_empty() {
            return Ok(state.with(state.rows().to_vec(), step.end()));
        }
        let states = state.rows();
        let values: Vec<BodyState> = states.iter().map(BodyState::value).collect();
        let plain = model.to_f64();
        let mut at_end = values.clone();
        plain.place_bodies(&mut at_end, step.end());
        let mut equations =
            ImplicitStep { model: &plain, leaky: &plain, states: &values, at_end, free, step };
        let solution = equations.solve()?;
        if S::ORDER == 0 {
            let velocity = |slot| velocity_at(&solution, slot).map(S::constant);
            let next = moved(model, states, &equations, velocity);
            return Ok(state.with(deflected(model, next, &equations.step), step.end()));
        }
        // Leaks are in derivatives only.
        let leaky = model.map(S::value);
        equations.leaky = &leaky;
        let (_, jacobian) = equations
            .linearize(&solution)
            .map_err(|_| equations.unsolved(equations.residual(&solution).norm(), 0))?;
        Ok(state.with(carried(model, states, &equations, &solution, &jacobian), step.end()))
    }

    fn stability_limit(&self) -> f64 {
        f64::INFINITY
    }
}

/// The states at the end of a step that free bodies make with these velocities, before contacts with bristles are deflected.
fn moved<S: Scalar>(
    model: &Model<S>,
    states: &Rows<S>,
    equations: &ImplicitStep<'_>,
    velocity: impl Fn(usize) -> [S; 6],
) -> Vec<BodyState<S>> {
    let mut next = states.to_vec();
    model.place_bodies(&mut next, equations.step.end());
    for (slot, &body) in equations.free.iter().enumerate() {
        next[body] = arrived(&states[body], &velocity(slot), equations.step.dt);
    }
    next
}

/// The states at the end, with the derivatives of the solution: x − J⁻¹F(x), where F carries those by all else.
fn carried<S: Scalar>(
    model: &Model<S>,
    states: &Rows<S>,
    equations: &ImplicitStep<'_>,
    solution: &DVector<f64>,
    jacobian: &Factored,
) -> Vec<BodyState<S>> {
    let velocity = |slot: usize| velocity_at(solution, slot).map(S::constant);
    let next = moved(model, states, equations, velocity);
    let wrenches = model.wrenches_of(&next, equations.step.index);
    let mut excesses = Vec::with_capacity(solution.len());
    for (slot, &body) in equations.free.iter().enumerate() {
        let Some(rigid) = model.bodies[body].rigid() else { continue };
        let (state, wrench, dt) = (&states[body], &wrenches[body], equations.step.dt);
        excesses.extend(excess(rigid, &model.gravity, state, &velocity(slot), wrench, dt));
    }
    let changes = S::solve(jacobian, &excesses);
    let velocity = |slot: usize| {
        let velocity = velocity(slot);
        std::array::from_fn(|i| velocity[i] - changes[6 * slot + i])
    };
    deflected(model, moved(model, states, equations, velocity), &equations.step)
}

/// Forces are those of the deflections at the start; these follow the motion at the end.
fn deflected<S: Scalar>(
    model: &Model<S>,
    mut next: Vec<BodyState<S>>,
    step: &Step,
) -> Vec<BodyState<S>> {
    if next.len() > model.bodies.len() {
        let rates = model.wrenches_of(&next, step.index);
        model.integrate_bristles(&mut next, &rates, S::constant(step.dt));
    }
    next
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use prehend_autodiff::Fwd;
    use prehend_autodiff::check::{compare_gradients, finite_difference_jacobian};

    use super::*;
    use crate::contact::LeakSteps;
    use crate::scenes::{bowl, egg_on};
    use crate::{GapSmoothing, Motion, RigidBody, TimeSteps};

    /// The egg in a bowl that flies freely.
    fn egg_in_free_bowl(smoothing: GapSmoothing) -> (Model, State) {
        let (mut model, mut states) = egg_on(bowl(), smoothing);
        let mut rigid = *model.bodies[1].rigid().unwrap();
        rigid = RigidBody::new(0.5, rigid.inertia() * 3.0, *rigid.com()).unwrap();
        model.bodies[0].motion = Motion::Dynamic(rigid);
        states[0] = rigid.at_rest(&nalgebra::Isometry3::identity());
        states[0].angular = Vector3::new(-0.5, 0.3, 0.2);
        states[1].pose.translation.z -= 5e-4;
        (model, states)
    }

    #[test]
    fn free_bodies_are_solved_and_differentiated_together() {
        let (model, states) = egg_in_free_bowl(GapSmoothing::Softplus { width: 3e-4 });
        let time_steps = TimeSteps { dt: 2e-3, steps: 3 };
        for moving in 0..2 {
            let mut lifted: State<Fwd<12>> = states.cast();
            lifted[moving] = states[moving].variables();
            let run =
                model.cast().simulate_with(&BackwardEuler, &lifted, time_steps).unwrap().states;
            let differences = finite_difference_jacobian(
                |x| {
                    let mut moved = states.clone();
                    let tangent = std::array::from_fn::<f64, 12, _>(|i| x[i]);
                    moved[moving] = states[moving].retract(&tangent);
                    let run =
                        model.simulate_with(&BackwardEuler, &moved, time_steps).unwrap().states;
                    let velocities = run.bodies().iter().flat_map(|s| [s.linear, s.angular]);
                    velocities.flat_map(|v| [v.x, v.y, v.z]).collect()
                },
                &[0.0; 12],
                1e-6,
            );
            let exact = run.bodies().iter().flat_map(|s| [s.linear, s.angular]);
            for (exact, reference) in exact.flat_map(|v| [v.x, v.y, v.z]).zip(&differences) {
                let error = compare_gradients(&exact.derivative, reference);
                assert!(error.relative < 1e-6, "body {moving}: {error:?}");
            }
        }
        let plain = model.simulate_with(&BackwardEuler, &states, time_steps).unwrap().states;
        let momentum = |states: &State| states[0].linear * 0.5 + states[1].linear * 0.2;
        let gained = model.gravity * (0.7 * 6e-3);
        assert!((momentum(&plain) - momentum(&states) - gained).norm() < 1e-14);
    }

    #[test]
    fn steps_far_beyond_the_stability_limit_come_to_rest() {
        let (mut model, states) = egg_on(bowl(), GapSmoothing::Softplus { width: 3e-4 });
        model.contacts[0].params_mut()[0] *= 1e3;
        let mut hit = states.clone();
        hit[1].pose.translation.z -= 1e-3;
        assert!(0.01 * model.contact_frequency(&hit) > 50.0);
        let time_steps = TimeSteps { dt: 0.01, steps: 300 };
        let end = model.simulate_with(&BackwardEuler, &states, time_steps).unwrap().states[1];
        assert!(end.linear.norm() < 1e-3 && end.angular.norm() < 0.1, "{end:?}");
    }

    #[test]
    fn leaks_matter_to_derivatives_only() {
        let leaky = GapSmoothing::Leaky { alpha: 0.1, band: 1e-2, steps: LeakSteps::All };
        let ends = [GapSmoothing::Hard, leaky].map(|smoothing| {
            let (model, mut states) = egg_on(bowl(), smoothing);
            states[1].pose.translation.z += 5e-3;
            let lifted = State::new([states[0].cast(), states[1].variables()]);
            let step = Step::new(0, 1e-3);
            BackwardEuler.step(&model.cast(), &lifted, step).unwrap()[1]
        });
        assert_eq!(ends[0].value(), ends[1].value());
        let slope = |end: &BodyState<Fwd<12>>| end.linear.z.derivative[2];
        assert_eq!(slope(&ends[0]), 0.0);
        assert!(slope(&ends[1]) < -1e-2, "{}", slope(&ends[1]));
    }

    #[test]
    fn nothing_free_is_nothing_to_solve() {
        let (mut model, states) = egg_on(bowl(), GapSmoothing::Hard);
        model.bodies[1].motion = Motion::Fixed;
        let step = Step::new(0, 1e-3);
        assert_eq!(BackwardEuler.step(&model, &states, step).unwrap().bodies(), states.bodies());
    }

    /// Enough bodies for sparse equations, where those are compiled.
    #[test]
    fn a_pile_is_solved_and_differentiated_together() {
        const BALLS: usize = 27;
        let radius = 0.05;
        let mut model = Model::new(Vector3::z() * -9.81);
        let ground = crate::Body::fixed("ground").with_field(crate::scenes::floor());
        let ground = model.add(ground);
        let mut states = vec![BodyState::at_rest(nalgebra::Isometry3::identity())];
        let rigid = RigidBody::ball(0.5, radius).unwrap();
        let surface = std::sync::Arc::new(crate::Surface::ball(radius).unwrap());
        let field = std::sync::Arc::new(crate::fields::Sphere {
            center: nalgebra::Point3::origin(),
            radius,
        });
        let place = |i: usize| 0.0998 * i as f64;
        for i in 0..BALLS {
            let ball = crate::Body::dynamic(&format!("ball {i}"), rigid);
            model.add(ball.with_surface(surface.clone()).with_field(field.clone()));
            let (x, y, z) = (place(i % 3), place(i / 3 % 3), 0.0499 + place(i / 9));
            states.push(rigid.at_rest(&nalgebra::Isometry3::translation(x, y, z)));
        }
        let states = State::new(states);
        let balls: Vec<_> = model.free_bodies();
        let law = std::sync::Arc::new(crate::scenes::penalty(1e6, 1e4, 0.5, 1e-2));
        let smoothing = GapSmoothing::Softplus { width: 3e-4 };
        model.add_contacts_between(&balls, &[ground], law.clone(), smoothing).unwrap();
        model.add_contacts_between(&balls, &balls, law, smoothing).unwrap();
        let time_steps = TimeSteps { dt: 2e-3, steps: 2 };
        let end = |push: [f64; 2]| {
            let mut states = states.clone();
            (states[1].linear.x, states[BALLS].angular.y) = (0.1 + push[0], push[1]);
            let run = model.simulate_with(&BackwardEuler, &states, time_steps);
            let states = run.unwrap().states;
            states.bodies().iter().flat_map(|s| [s.linear.x, s.linear.z, s.angular.y]).collect()
        };
        let mut lifted: State<Fwd<2>> = states.cast();
        lifted[1].linear.x = Fwd::variable(0.1, 0);
        lifted[BALLS].angular.y = Fwd::variable(0.0, 1);
        let run = model.cast().simulate_with(&BackwardEuler, &lifted, time_steps);
        let exact: Vec<Fwd<2>> = (run.unwrap().states.bodies().iter())
            .flat_map(|s| [s.linear.x, s.linear.z, s.angular.y])
            .collect();
        let differences = finite_difference_jacobian(|x| end([x[0], x[1]]), &[0.0; 2], 1e-6);
        let largest = differences.iter().flatten().fold(0.0, |max: f64, x| max.max(x.abs()));
        for (exact, reference) in exact.iter().zip(&differences) {
            for (exact, reference) in exact.derivative.iter().zip(reference) {
                assert!((exact - reference).abs() < 1e-6 * largest, "{exact} {reference}");
            }
        }
    }
}
