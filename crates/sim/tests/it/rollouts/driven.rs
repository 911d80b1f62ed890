//! Derivatives by the trajectory of a body that pushes another.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Vector3};
use prehend_autodiff::check::{compare_gradients, finite_difference_jacobian};
use prehend_autodiff::lie::so3_exp;
use prehend_autodiff::{Fwd, Recording, Scalar, Var, gradient};
use prehend_sim::articulated::{Joint, Link};
use prehend_sim::fields::Sphere;
use prehend_sim::{
    Adaptive, Batch, Body, BodyState, BuildError, ContactBodies, GapSmoothing, Integrator, Model,
    Motion, RigidBody, RungeKutta4, SemiImplicitEuler, SimulationError, State, Step, Surface,
    TimeSteps,
    integrator::{BackwardEuler, StepCheckpointed, SubStepped},
    model::Trajectory,
};

use super::gradients::coordinates;
use crate::scenes::{floor, sticking};

const TIME: f64 = 0.06;
/// Speed \[m/s\], then the waypoint: aside \[m\] and turned \[rad\].
const INPUTS: [f64; 4] = [0.2, 1e-3, 2e-3, 0.05];
/// Units of the inputs.
const UNITS: [f64; 4] = [0.1, 1e-2, 1e-2, 0.1];

/// Along x at a speed, by a waypoint at half of the time.
fn course<S: Scalar>([speed, x, y, turn]: [S; 4]) -> impl Trajectory<S> {
    move |time: f64| {
        let phase = std::f64::consts::PI * time / TIME;
        let share = phase.sin().powi(2);
        let rate = std::f64::consts::PI / TIME * (2.0 * phase).sin();
        let (place, aside) = (speed.times(time), Vector3::new(x, y, S::zero()));
        let pose = Isometry3::from_parts(
            Translation3::from(
                aside.map(|a| a.times(share)) + Vector3::new(place, S::zero(), S::zero()),
            ),
            so3_exp(&Vector3::new(S::zero(), S::zero(), turn.times(share))),
        );
        let linear = aside.map(|a| a.times(rate)) + Vector3::new(speed, S::zero(), S::zero());
        BodyState { pose, linear, angular: Vector3::new(S::zero(), S::zero(), turn.times(rate)) }
    }
}

/// A block on the floor and a ball that will push it off its center, and where they are at the start.
fn scene<S: Scalar>(inputs: [S; 4]) -> (Model<S>, State<S>) {
    let inertia = Matrix3::from_diagonal(&Vector3::new(5e-5, 6e-5, 7e-5));
    let rigid = RigidBody::new(0.2, inertia, Point3::new(1e-3, 0.0, -2e-3)).unwrap();
    let surface = Surface::cuboid([0.02; 3], 5e-3).unwrap();
    let ball = Arc::new(Sphere { center: Point3::new(-0.031, 5e-3, 0.02), radius: 0.01 });
    let mut model = Model::new(Vector3::z() * -9.81);
    let ground = model.add(Body::fixed("floor").with_field(floor()));
    let samples = model.add(Body::dynamic("block", rigid).with_surface(surface));
    let pusher = model.add(Body::kinematic("pusher", course(INPUTS)).with_field(ball));
    for (field, stiffness) in [(ground, 2e6), (pusher, 5e7)] {
        let law = Arc::new(sticking(stiffness, 1e-3 * stiffness, 0.4, 3e-2));
        let smoothing = GapSmoothing::Softplus { width: 2e-4 };
        model.add_contact(ContactBodies { samples, field }, law, smoothing).unwrap();
    }
    let still = BodyState::at_rest(Isometry3::identity());
    let stands = rigid.at_rest(&Isometry3::translation(0.0, 0.0, 0.0194));
    let mut lifted = model.cast();
    lifted.bodies[pusher].motion = Motion::Kinematic(Arc::new(course(inputs)));
    (lifted, State::new([still, stands, still]).cast())
}

/// Where the block ends, by changes of the inputs.
fn pushed<S: Scalar>(integrator: &impl Integrator, dt: f64, change: &[S]) -> Vec<S> {
    let input = |i: usize| change[i].times(UNITS[i]).plus(INPUTS[i]);
    let (model, start) = scene(std::array::from_fn(input));
    let time_steps = TimeSteps { dt, steps: (TIME / dt).round() as usize };
    let end = model.simulate_with(integrator, &start, time_steps).unwrap().states;
    coordinates(&end[1])
}

/// `tight` is the integrator to take differences with, which agree to `tolerance`.
fn check(integrator: &impl Integrator, tight: &impl Integrator, dt: f64, tolerance: f64) {
    let end = pushed(integrator, dt, &Fwd::<4>::variables([0.0; 4]));
    assert!(end[0].value > 5e-3 && end[5].value.abs() > 1e-2, "{end:?}");
    let exact: Vec<[f64; 4]> = end.iter().map(|x| x.derivative).collect();
    let differences = finite_difference_jacobian(|x| pushed(tight, dt, x), &[0.0; 4], 1e-5);
    let largest = |rows: std::ops::Range<usize>| {
        exact[rows].as_flattened().iter().fold(0.0, |a: f64, x| a.max(x.abs()))
    };
    // Place, orientation and velocities, each relative to its largest slope.
    for rows in [0..3, 3..7, 7..10, 10..13] {
        let scale = largest(rows.clone());
        for row in rows {
            for (a, b) in exact[row].iter().zip(&differences[row]) {
                let error = (a - b).abs() / scale;
                assert!(error < tolerance, "row {row}: {:?} {:?}", exact[row], differences[row]);
            }
        }
    }
    let sum = |x: &[Var]| pushed(integrator, dt, x).into_iter().fold(Var::from(0.0), |a, b| a + b);
    let columns: Vec<f64> = (0..4).map(|i| exact.iter().map(|row| row[i]).sum()).collect();
    let error = compare_gradients(&gradient(sum, &[0.0; 4]).1, &columns);
    assert!(error.relative < 1e-9, "{error:?}");
}

#[test]
fn a_push_by_speed_and_waypoint_of_what_pushes() {
    let tight = Adaptive { tolerance: 1e-8, sensitivity_tolerance: 1e-7, ..Adaptive::default() };
    check(&Adaptive::default(), &tight, TIME, 1e-4);
    check(&SemiImplicitEuler, &SemiImplicitEuler, 4e-4, 1e-6);
    check(&RungeKutta4, &RungeKutta4, 4e-4, 1e-6);
    check(&BackwardEuler, &BackwardEuler, 2e-3, 1e-6);
}

#[test]
fn checkpoints_refuse_a_trajectory_that_carries_derivatives() {
    let recording = Recording::start();
    let (model, start) = scene(INPUTS);
    let (carrying, lifted_start) = scene(recording.variables(INPUTS));
    let time_steps = TimeSteps { dt: 1e-4, steps: 3 };
    let error: SimulationError =
        BuildError::TrajectoryDerivatives { body: "pusher".to_owned() }.into();
    let compact = StepCheckpointed::new(SemiImplicitEuler, &model).unwrap();
    let run = carrying.simulate_with(&compact, &lifted_start, time_steps);
    assert_eq!(run.unwrap_err(), error);
    assert_eq!(StepCheckpointed::new(SemiImplicitEuler, &carrying).unwrap_err(), error);
    // A plain one, lifted, is known again.
    let run = model.cast().simulate_with(&compact, &lifted_start, time_steps);
    let expected = model.simulate_with(&SemiImplicitEuler, &start, time_steps);
    let values = run.unwrap().states.value();
    assert_eq!(values, expected.unwrap().states);
}

#[test]
fn runs_go_on_from_the_time_of_their_state() {
    fn check(integrator: &(impl Integrator + Clone + Send + 'static), tolerance: f64) {
        let (model, start) = scene(INPUTS);
        let time_steps = |steps| TimeSteps { dt: 2e-4, steps };
        let run = |from: &State, steps| {
            model.simulate_with(integrator, from, time_steps(steps)).unwrap().states
        };
        let (whole, half) = (run(&start, 300), run(&start, 150));
        assert!((half.time - 0.5 * TIME).abs() < 1e-12, "{}", half.time);
        let mut seen = Vec::new();
        let look = |_, _: &mut Model, state: &mut State| seen.push(state.time);
        let controlled = model.simulate_controlled(integrator, &half, time_steps(150), look);
        let batch = Batch::with_integrator(integrator.clone(), &model).unwrap();
        let mut of_batch = batch.simulate([(model.clone(), half.clone())], time_steps(150));
        let ends = [run(&half, 150), controlled.unwrap().states, of_batch.remove(0).unwrap()];
        for end in ends {
            assert!((end.time - TIME).abs() < 1e-12, "{}", end.time);
            for (a, b) in end.bodies().iter().zip(whole.bodies()) {
                let pairs = coordinates(a).into_iter().zip(coordinates(b));
                let difference = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(difference < tolerance, "{difference}");
            }
        }
        assert!((seen[0] - half.time).abs() < 1e-15 && (seen[149] - TIME + 2e-4).abs() < 1e-12);
    }
    check(&SemiImplicitEuler, 1e-11);
    check(&RungeKutta4, 1e-11);
    check(&SubStepped { integrator: SemiImplicitEuler, max_substeps: 2 }, 1e-11);
    check(&Adaptive::default(), 1e-4);
}

#[test]
fn errors_tell_the_time_of_a_late_start() {
    let (model, mut state) = scene(INPUTS);
    state.time = 5.0;
    state[1].linear.z = -1e160;
    let late = model.simulate_with(&SemiImplicitEuler, &state, TimeSteps { dt: 1e-3, steps: 1 });
    let late = late.unwrap_err().to_string();
    assert!(late.contains("at 5.00"), "{late}");
    state.time = f64::NAN;
    let never = model.simulate(&state, 1e-3).unwrap_err().to_string();
    assert!(never.contains("time of a state"), "{never}");
}

#[test]
fn states_of_other_worlds_are_refused() {
    let mut model = Model::new(Vector3::zeros());
    let rod =
        Link::new("rod", Joint::Revolute(Vector3::y_axis()), &RigidBody::ball(1.0, 0.1).unwrap());
    model.add_articulation(vec![rod]).unwrap();
    assert!(model.simulate(&model.neutral_state(), 1e-3).is_ok());
    // As many rows as a link and its joint.
    let bodies = State::new([BodyState::at_rest(Isometry3::identity()); 2]);
    let refused = model.simulate(&bodies, 1e-3).unwrap_err();
    assert!(matches!(refused, SimulationError::States { .. }), "{refused}");
    let step = Step::new(0, 1e-3);
    assert!(model.step(&SemiImplicitEuler, &bodies, step).is_err());
    assert!(model.linearize_step(&bodies, step).is_err());
}
