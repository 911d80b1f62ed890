//! Requirements on every integrator.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3, Vector6};
use prehend_autodiff::check::{compare_gradients, finite_difference_jacobian};
use prehend_autodiff::lie::so3_log;
use prehend_autodiff::{Fwd, Recording, Scalar, Var};
use prehend_sim::{
    Body, BodyState, GapSmoothing, Integrator, Model, Motion, RigidBody, RungeKutta4,
    SemiImplicitEuler, SimulationError, State, Step, Surface, TimeSteps,
    integrator::{BackwardEuler, SubStepped},
};

use crate::scenes::{bowl, egg_on, floor, on_ground, penalty, sticking};

/// Calls a check that is generic over the integrator with each of them.
macro_rules! for_every_integrator {
    ($check:expr) => {{
        $check(&SemiImplicitEuler);
        $check(&RungeKutta4);
        $check(&BackwardEuler);
        $check(&SubStepped { integrator: SemiImplicitEuler, max_substeps: 64 });
    }};
}

/// A model and the same with friction that holds.
fn sliding_and_sticking(model: Model) -> [Model; 2] {
    let mut holds = model.clone();
    let [stiffness, damping, friction] = [0, 1, 2].map(|i| model.contacts[0].params()[i]);
    holds.contacts[0].set_law(Arc::new(sticking(stiffness, damping, friction, 2e-2)));
    [model, holds]
}

/// An asymmetric body that tumbles freely.
fn top(gravity: Vector3<f64>) -> (Model, State) {
    let turned = nalgebra::Rotation3::new(Vector3::new(0.3, -0.5, 0.2));
    let principal = Matrix3::from_diagonal(&Vector3::new(1e-3, 2e-3, 2.5e-3));
    let inertia = turned.matrix() * principal * turned.matrix().transpose();
    let rigid = RigidBody::new(0.4, inertia, Point3::new(0.01, 0.02, -0.01)).unwrap();
    let mut model = Model::new(gravity);
    model.add(Body::dynamic("top", rigid));
    let pose = Isometry3::new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.4, 0.1, -0.6));
    let mut state = rigid.at_rest(&pose);
    state.linear = Vector3::new(0.3, -0.2, 0.1);
    state.angular = Vector3::new(4.0, 3.0, -2.0);
    (model, State::new([state]))
}

/// A table on four legs that always touch the floor: its springs, dampers and friction are smooth.
fn table(damping: f64) -> (Model, State) {
    let inertia = Matrix3::from_diagonal(&Vector3::new(4e-4, 6e-4, 8e-4));
    let rigid = RigidBody::new(0.3, inertia, Point3::new(0.0, 0.005, 0.03)).unwrap();
    let legs = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]
        .map(|(x, y)| Point3::new(0.05 * x, 0.05 * y, 0.0));
    let surface = Surface::new(&legs, &[1e-4; 4]).unwrap();
    let friction = if damping > 0.0 { 0.4 } else { 0.0 };
    let (law, down) = (penalty(1e6, damping, friction, 0.3), Vector3::new(0.0, 0.0, -9.81));
    let table = Body::dynamic("table", rigid).with_surface(surface);
    let model = on_ground(down, floor(), table, Arc::new(law), GapSmoothing::Hard);
    let sunk = 0.3 * 9.81 / (4e-4 * 1e6);
    let pose = Isometry3::new(Vector3::new(0.0, 0.0, -sunk), Vector3::new(0.01, 0.02, 0.3));
    let mut state = rigid.at_rest(&pose);
    (state.linear.z, state.angular.x) = (0.05, 0.1);
    if damping > 0.0 {
        state.linear.x = 0.2;
    }
    (model, State::new([BodyState::at_rest(Isometry3::identity()), state]))
}

fn end(model: &Model, states: &State, integrator: &impl Integrator, dt: f64, time: f64) -> State {
    let time_steps = TimeSteps { dt, steps: (time / dt).round() as usize };
    model.simulate_with(integrator, states, time_steps).unwrap().states
}

/// Position, rotation vector from `base`, and velocities.
fn coordinates(state: &BodyState, base: &BodyState) -> Vec<f64> {
    let turn = so3_log(&(state.pose.rotation * base.pose.rotation.inverse()));
    let parts = [state.pose.translation.vector, turn, state.linear, state.angular];
    parts.iter().flat_map(|v| v.iter().copied()).collect()
}

fn distance(a: &BodyState, b: &BodyState) -> f64 {
    coordinates(a, b)
        .iter()
        .zip(coordinates(b, b))
        .map(|(a, b)| (a - b).powi(2))
        .sum::<f64>()
        .sqrt()
}

#[test]
fn free_fall_gains_velocity_exactly() {
    fn check(integrator: &impl Integrator) {
        let (model, states) = top(Vector3::new(0.0, 0.0, -9.81));
        let fallen = end(&model, &states, integrator, 1e-3, 1.0)[0];
        let expected = states[0].linear + model.gravity;
        assert!((fallen.linear - expected).norm() < 1e-11);
    }
    for_every_integrator!(check);
}

#[test]
fn momentum_is_conserved_without_forces() {
    fn check(integrator: &impl Integrator) {
        let (model, states) = top(Vector3::zeros());
        let rigid = model.bodies[0].rigid().unwrap();
        let momentum =
            |state: &BodyState| rigid.world_inertia(&state.pose.rotation) * state.angular;
        let later = end(&model, &states, integrator, 1e-3, 1.0)[0];
        let (before, after) = (momentum(&states[0]), momentum(&later));
        assert!((after - before).norm() < 1e-10 * before.norm(), "{}", (after - before).norm());
        assert!((later.linear - states[0].linear).norm() < 1e-10);
    }
    for_every_integrator!(check);
}

/// Orders measured from two halvings of the step.
fn orders(
    model: &Model,
    states: &State,
    integrator: &impl Integrator,
    dt: f64,
    time: f64,
) -> [f64; 2] {
    let body = states.bodies().len() - 1;
    let exact = end(model, states, &RungeKutta4, dt / 64.0, time)[body];
    let error = |dt: f64| distance(&end(model, states, integrator, dt, time)[body], &exact);
    let [a, b, c] = [1.0, 2.0, 4.0].map(|halving| error(dt / halving));
    [(a / b).log2(), (b / c).log2()]
}

#[test]
fn orders_are_as_documented() {
    fn check(integrator: &impl Integrator, order: f64) {
        let (model, states) = top(Vector3::new(0.0, 0.0, -9.81));
        let spinning = orders(&model, &states, integrator, 0.02, 1.0);
        let (model, states) = table(2e4);
        let [touching, holding] =
            sliding_and_sticking(model).map(|model| orders(&model, &states, integrator, 5e-4, 0.1));
        for measured in spinning.iter().chain(&touching).chain(&holding) {
            let all = [spinning, touching, holding];
            assert!((measured - order).abs() < 0.15, "{order}: {all:?}");
        }
    }
    check(&SemiImplicitEuler, 1.0);
    check(&RungeKutta4, 4.0);
    check(&BackwardEuler, 1.0);
}

/// Kinetic, elastic and gravitational energy of the undamped table \[J\].
fn energy(model: &Model, state: &BodyState) -> f64 {
    let rigid = model.bodies[1].rigid().unwrap();
    let at = rigid.body_pose(&state.pose);
    let surface = model.bodies[1].surface.as_ref().unwrap();
    let elastic = |depth: f64| 0.5 * 1e6 * 1e-4 * depth.min(0.0).powi(2);
    let springs: f64 = surface.points().iter().map(|p| elastic((at * p.position).z)).sum();
    let inertia = rigid.world_inertia(&state.pose.rotation);
    let turning = 0.5 * state.angular.dot(&(inertia * state.angular));
    springs
        + turning
        + rigid.mass() * (0.5 * state.linear.norm_squared() + 9.81 * state.pose.translation.z)
}

#[test]
fn energy_behaves() {
    fn drift(integrator: &impl Integrator) -> (f64, f64) {
        let (model, states) = table(0.0);
        let start = energy(&model, &states[1]);
        let rest = energy(
            &model,
            &BodyState { linear: Vector3::zeros(), angular: Vector3::zeros(), ..states[1] },
        );
        let time_steps = TimeSteps { dt: 1e-3, steps: 10_000 };
        let run = model.rollout_with(integrator, &states, time_steps).unwrap().states;
        let drift = |state: &State| (energy(&model, &state[1]) - start) / (start - rest);
        (run.iter().map(|state| drift(state).abs()).fold(0.0, f64::max), drift(&run[10_000]))
    }
    assert!(drift(&SemiImplicitEuler).0 < 0.1);
    assert!(drift(&RungeKutta4).0 < 1e-5);
    assert!(drift(&BackwardEuler).1 < -0.5);
}

#[test]
fn derivatives_match_differences() {
    fn check(integrator: &impl Integrator) {
        let (mut model, mut states) = egg_on(bowl(), GapSmoothing::Softplus { width: 3e-4 });
        states[1].pose.translation.z -= 5e-4;
        // So little damping that contacts, which never pull, are not cut off: that would be a kink.
        model.contacts[0].params_mut()[1] = 2e3;
        let worlds = sliding_and_sticking(model);
        for (model, steps) in worlds.iter().flat_map(|model| [(model, 1), (model, 30)]) {
            let time_steps = TimeSteps { dt: 1e-3, steps };
            let mut lifted: State<Fwd<12>> = states.cast();
            lifted[1] = states[1].variables();
            let end =
                model.cast().simulate_with(integrator, &lifted, time_steps).unwrap().states[1];
            let fallen = states[1].linear + model.gravity * (1e-3 * steps as f64);
            assert!(steps == 1 || (end.value().linear - fallen).norm() > 0.05, "no contact");
            let exact = end.sensitivity();
            let differences = finite_difference_jacobian(
                |x| {
                    let mut moved = states.clone();
                    moved[1] = states[1].retract(&std::array::from_fn::<f64, 12, _>(|i| x[i]));
                    let run = model.simulate_with(integrator, &moved, time_steps).unwrap().states;
                    coordinates(&run[1], &end.value())
                },
                &[0.0; 12],
                2e-6,
            );
            for (row, reference) in differences.iter().enumerate() {
                let exact: Vec<f64> = exact.row(row).iter().copied().collect();
                let error = compare_gradients(&exact, reference);
                assert!(error.relative < 1e-6, "{steps} steps, row {row}: {error:?}");
            }
        }
    }
    for_every_integrator!(check);
}

/// The egg of a model with its parameters, in multiples of their values: stiffness, damping and friction of the contact,
/// mass, inertia, gravity, an external wrench, and the center of mass.
fn with_parameters<S: Scalar>(model: &Model, factors: &[S]) -> Model<S> {
    let mut changed = model.cast::<S>();
    for (param, factor) in changed.contacts[0].params_mut().iter_mut().zip(factors) {
        *param *= *factor;
    }
    let rigid = model.bodies[1].rigid().unwrap();
    let inertia = rigid.inertia().map(|x| factors[4].times(x));
    let com = rigid.com().map(|x| factors[7].times(x));
    let rigid = RigidBody::new(factors[3].times(rigid.mass()), inertia, com).unwrap();
    changed.bodies[1].motion = Motion::Dynamic(rigid);
    changed.gravity *= factors[5];
    changed.bodies[1].external_wrench =
        Vector6::new(0.3, 0.1, 0.0, 0.0, 1e-3, 1e-3).map(|x| factors[6].times(x));
    changed
}

#[test]
fn derivatives_by_parameters_match_differences() {
    fn check(integrator: &impl Integrator) {
        let (mut model, mut states) = egg_on(bowl(), GapSmoothing::Softplus { width: 3e-4 });
        states[1].pose.translation.z -= 5e-4;
        model.contacts[0].params_mut()[1] = 2e3;
        let time_steps = TimeSteps { dt: 1e-3, steps: 10 };
        for model in sliding_and_sticking(model) {
            let lifted: State<Fwd<8>> = states.cast();
            let changed = with_parameters(&model, &Fwd::<8>::variables([1.0; 8]));
            let end = changed.simulate_with(integrator, &lifted, time_steps).unwrap().states[1];
            let exact = end.sensitivity();
            let differences = finite_difference_jacobian(
                |x| {
                    let changed = with_parameters(&model, x);
                    let run =
                        changed.simulate_with(integrator, &states, time_steps).unwrap().states;
                    coordinates(&run[1], &end.value())
                },
                &[1.0; 8],
                1e-5,
            );
            for (row, reference) in differences.iter().enumerate() {
                let exact: Vec<f64> = exact.row(row).iter().copied().collect();
                let error = compare_gradients(&exact, reference);
                assert!(error.relative < 1e-6, "row {row}: {error:?}");
                assert!(row < 6 || exact.iter().all(|slope| *slope != 0.0));
            }
        }
    }
    for_every_integrator!(check);
}

#[test]
fn adjoints_agree_with_forward_mode() {
    fn weighted<S: Scalar>(states: &State<S>) -> S {
        let tangent = states[1].tangent();
        (1..).zip(tangent).fold(S::zero(), |sum, (i, x)| sum + x.times(f64::from(i).sin()))
    }
    fn check(integrator: &impl Integrator) {
        let (model, states) = egg_on(bowl(), GapSmoothing::Softplus { width: 3e-4 });
        let time_steps = TimeSteps { dt: 1e-3, steps: 30 };
        for model in sliding_and_sticking(model) {
            let friction = model.contacts[0].params()[2];
            let mut forward_world = model.cast::<Fwd<13>>();
            let variables = Fwd::<13>::variables([0.0; 13]);
            forward_world.contacts[0].params_mut()[2] = variables[12].plus(friction);
            let start = |tangent: &[Fwd<13>]| {
                let mut start: State<Fwd<13>> = states.cast();
                start[1] = states[1].retract(&std::array::from_fn::<_, 12, _>(|i| tangent[i]));
                start
            };
            let run = forward_world.simulate_with(integrator, &start(&variables), time_steps);
            let forward = weighted(&run.unwrap().states).derivative;

            let recording = Recording::start();
            let variables: [Var; 13] = recording.variables([0.0; 13]);
            let mut reverse_world = model.cast::<Var>();
            reverse_world.contacts[0].params_mut()[2] = variables[12].plus(friction);
            let start = State::new([
                states[0].cast(),
                states[1].retract(&std::array::from_fn::<_, 12, _>(|i| variables[i])),
            ]);
            let run = reverse_world.simulate_with(integrator, &start, time_steps).unwrap().states;
            let adjoints = recording.gradient(weighted(&run));
            let reverse: Vec<f64> = variables.iter().map(|x| adjoints.wrt(*x)).collect();
            let error = compare_gradients(&reverse, &forward);
            assert!(error.relative < 1e-12 && forward[12] != 0.0, "{error:?}");
        }
    }
    for_every_integrator!(check);
}

/// A point mass on a spring and damper, along z: its angular frequency is `omega`, its damping rate `rate` \[1/s\].
fn oscillator(omega: f64, rate: f64) -> (Model, State) {
    let rigid = RigidBody::new(1.0, Matrix3::identity(), Point3::origin()).unwrap();
    let surface = Surface::new(&[Point3::origin()], &[1e-2]).unwrap();
    let law = Arc::new(penalty(omega * omega * 1e2, rate * 1e2, 0.0, 1.0));
    let mass = Body::dynamic("mass", rigid).with_surface(surface);
    let model = on_ground(Vector3::z() * -9.81, floor(), mass, law, GapSmoothing::Hard);
    let rest = BodyState::at_rest(Isometry3::translation(0.0, 0.0, -9.81 / (omega * omega)));
    (model, State::new([BodyState::at_rest(Isometry3::identity()), rest]))
}

/// An impact on a damped contact without smoothing: without touching the mass ends the step below the floor, and with the
/// damper's jump of force above it.
fn jump() -> (Model, State, Step) {
    let (model, mut states) = oscillator(10.0, 200.0);
    states[1].linear.z = -1.0;
    states[1].pose.translation.z = 0.8 * 0.01;
    (model, states, Step::new(3, 0.01))
}

#[test]
fn a_jump_without_a_solution_is_an_error() {
    let (model, states, step) = jump();
    let error = BackwardEuler.step(&model, &states, step).unwrap_err();
    let SimulationError::Unsolved { step: 3, time, residual, iterations, .. } = error else {
        panic!("{error}");
    };
    assert!((time - 0.03).abs() < 1e-15 && residual > 1e-3 && iterations > 0);
    let told = error.to_string();
    assert!(told.contains("step 3") && told.contains(&model.bodies[1].name), "{told}");
}

#[test]
fn what_an_implicit_step_does_not_solve_shorter_ones_do() {
    let (model, states, step) = jump();
    let divided = SubStepped { integrator: BackwardEuler, max_substeps: 64 };
    let end = divided.step(&model, &states, step).unwrap()[1];
    assert!(end.linear.z < 0.0 && end.linear.z > states[1].linear.z + 0.1);
    let once = SubStepped { integrator: BackwardEuler, max_substeps: 1 };
    assert!(matches!(
        once.step(&model, &states, step),
        Err(SimulationError::Unsolved { step: 3, .. })
    ));
}

#[test]
fn limits_of_stability_are_as_documented() {
    fn grows(integrator: &impl Integrator, omega: f64, rate: f64) -> bool {
        let (model, mut states) = oscillator(omega, rate);
        let rest = states[1].pose.translation.z;
        states[1].pose.translation.z *= 1.0 + 1e-9;
        let run = model.rollout_with(integrator, &states, TimeSteps { dt: 1.0, steps: 400 });
        let run = match run {
            // What makes energy grows.
            Err(SimulationError::Energy { .. }) => return true,
            run => run.unwrap().states,
        };
        let away = |i: usize| (run[i][1].pose.translation.z - rest).abs();
        // The largest of the last against that of the first: an oscillation passes rest.
        let largest = |from: usize| (from..from + 50).map(away).fold(0.0, f64::max);
        largest(350) > 1.5 * largest(0)
    }
    fn check(integrator: &impl Integrator, worst: (f64, f64), undamped: f64) {
        let limit = integrator.stability_limit();
        let (omega, rate) = worst;
        assert!(!grows(integrator, 0.99 * limit * omega, 0.99 * limit * rate));
        assert!(grows(integrator, 1.02 * limit * omega, 1.02 * limit * rate));
        assert!(
            !grows(integrator, 0.99 * undamped, 0.0) && grows(integrator, 1.02 * undamped, 0.0)
        );
    }
    check(&SemiImplicitEuler, (1.0, 1.0), 2.0);
    check(&RungeKutta4, (1.0, 1.0), 8f64.sqrt());
    for scale in [1.0, 1e3] {
        assert!(!grows(&BackwardEuler, scale, 0.0) && !grows(&BackwardEuler, scale, scale));
    }
}

#[test]
fn the_check_of_the_step_knows_the_integrator() {
    let (model, states) = oscillator(100.0, 0.0);
    let check = model.check_time_step(&SemiImplicitEuler, &states, 0.02);
    assert!((check.unwrap_err().limit - 0.01236).abs() < 1e-9);
    assert_eq!(model.check_time_step(&RungeKutta4, &states, 0.02), Ok(()));
    assert_eq!(model.check_time_step(&BackwardEuler, &states, 1e3), Ok(()));
    let divided = SubStepped { integrator: SemiImplicitEuler, max_substeps: 3 };
    assert_eq!(model.check_time_step(&divided, &states, 0.02), Ok(()));
}

#[test]
fn external_wrenches_and_driven_bodies_are_felt_at_their_time() {
    // A floor that rises with a constant acceleration carries the mass with it.
    fn check(integrator: &impl Integrator, order: i32) {
        let follow = |dt: f64| {
            let (mut model, states) = oscillator(100.0, 100.0);
            let heave = |t: f64| {
                let mut state =
                    BodyState::at_rest(Isometry3::translation(0.0, 0.0, 0.02 * t.sin()));
                state.linear.z = 0.02 * t.cos();
                state
            };
            model.bodies[0].motion = Motion::Kinematic(Arc::new(heave));
            model.bodies[1].external_wrench = Vector6::new(0.0, 0.0, -1.0, 0.0, 0.0, 0.0);
            let mut states = states;
            model.update_kinematics(&mut states);
            states[1].linear.z = 0.02;
            end(&model, &states, integrator, dt, 0.3)[1]
        };
        let (coarse, fine, exact) = (follow(2e-3), follow(1e-3), follow(1e-3 / 64.0));
        let ratio = distance(&coarse, &exact) / distance(&fine, &exact);
        assert!((ratio.log2() - f64::from(order)).abs() < 0.3, "order {order}: {}", ratio.log2());
    }
    check(&SemiImplicitEuler, 1);
    check(&RungeKutta4, 4);
    check(&BackwardEuler, 1);
}
