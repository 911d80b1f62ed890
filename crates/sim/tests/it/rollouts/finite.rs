//! Nothing finite leads to NaN, infinity or a panic: results are numbers, values and derivatives, or an error says which body it is about.

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3, Vector6};
use parry3d_f64::shape::Capsule;
use prehend_autodiff::{Fwd, Scalar};
use prehend_sim::articulated::{Articulation, Joint, Link};
use prehend_sim::contact::Stribeck;
use prehend_sim::fields::{HalfSpace, Sphere};
use prehend_sim::joint_law::{JointFriction, JointLimits, JointSpring};
use prehend_sim::{
    Adaptive, Body, BodyState, BristleFriction, ContactBodies, ContactCalibration, Coulomb,
    DynContactLaw, GapSmoothing, HuntCrossley, Integrator, KelvinVoigt, Law, Model, RigidBody,
    RolloutFunction, RolloutInputs, RungeKutta4, SemiImplicitEuler, Shape, SimulationError, State,
    Step, Surface, TimeSteps,
    integrator::{BackwardEuler, SubStepped},
};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

use super::gradients::coordinates;

/// As many lanes as other tests here have: less to compile.
type Lanes = Fwd<8>;

/// States with their pose and two directions of their velocity as variables.
fn variables(model: &Model, states: &State) -> State<Lanes> {
    let mut tangent = [Lanes::constant(0.0); 12];
    tangent[..8].copy_from_slice(&Lanes::variables([0.0; 8]));
    let rows = states.rows().iter().map(|state| state.retract(&tangent)).collect();
    model.cast().state_of_rows(rows, states.time).unwrap()
}

/// The numbers of `states` with their derivatives.
fn numbers(states: &State<Lanes>) -> Vec<f64> {
    let all = states.rows().iter().flat_map(coordinates);
    all.flat_map(|x| std::iter::once(x.value).chain(x.derivative)).collect()
}

/// Finite numbers, or an error about a body of `model`.
fn assert_told(what: &str, model: &Model, result: Result<Vec<f64>, SimulationError>) {
    match result {
        Ok(numbers) => assert!(numbers.iter().all(|x| x.is_finite()), "{what}: {numbers:?}"),
        Err(SimulationError::TimeStep(_) | SimulationError::Joints { .. }) => {}
        Err(error) => {
            let named = model.bodies.iter().any(|b| error.to_string().contains(&b.name));
            assert!(named, "{what}: {error}");
        }
    }
}

/// A few steps of `integrator` in both modes.
fn assert_steps(what: &str, integrator: &impl Integrator, model: &Model, states: &State, t: f64) {
    let time_steps = TimeSteps { dt: t / 4.0, steps: 4 };
    let forward = model.cast().simulate_with(integrator, &variables(model, states), time_steps);
    assert_told(what, model, forward.map(|run| numbers(&run.states)));
    let run = model.simulate_with(integrator, states, time_steps);
    let of_run = |run: prehend_sim::Simulation<State>| {
        run.states.rows().iter().flat_map(coordinates).chain(run.resolution.roughness).collect()
    };
    assert_told(what, model, run.map(of_run));
}

/// Everything that is asked of a model.
fn assert_all(what: &str, model: &Model, states: &State, time: f64) {
    let adaptive = Adaptive { max_substeps: 60, ..Adaptive::default() };
    let wrenches = model.cast().wrenches(&variables(model, states), 0);
    let of_wrench =
        |w: &Vector6<Lanes>| w.iter().flat_map(|x| [x.value, x.derivative[0]]).collect();
    let wrenches: Vec<Vec<f64>> = wrenches.iter().map(of_wrench).collect();
    assert!(wrenches.iter().flatten().all(|x| x.is_finite()), "{what}: {wrenches:?}");
    assert!(!model.contact_frequency(states).is_nan(), "{what}");
    assert_steps(what, &adaptive, model, states, time);
    assert_steps(what, &SemiImplicitEuler, model, states, time);
    assert_steps(what, &RungeKutta4, model, states, time);
    assert_steps(what, &BackwardEuler, model, states, time);
    let divided = SubStepped { integrator: SemiImplicitEuler, max_substeps: 16 };
    assert_steps(what, &divided, model, states, time);
    assert_told(what, model, backward(model, states, time));
    let linear = model.linearize_step(states, Step::new(0, time));
    let of_step = |s: prehend_sim::LinearizedStep| {
        s.by_state.iter().chain(s.by_force.iter()).copied().collect()
    };
    assert_told(what, model, linear.map(of_step));
}

/// Derivatives by all states and parameters in reverse mode.
fn backward(model: &Model, states: &State, time: f64) -> Result<Vec<f64>, SimulationError> {
    let names = model.parameter_names();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let steps = TimeSteps { dt: time / 2.0, steps: 2 };
    let function = RolloutFunction::with_integrator(SemiImplicitEuler, model, steps, &names, &[])?;
    let (states, parameters) =
        (states.rows().iter().flat_map(coordinates).collect::<Vec<f64>>(), model.parameters());
    let inputs = RolloutInputs { states: &states, parameters: &parameters, controls: &[] };
    let mut run = function.evaluate(inputs)?;
    let gradient = function.vjp(inputs, &run, &vec![1.0; run.len()])?;
    run.extend(gradient.states.iter().chain(&gradient.parameters));
    Ok(run)
}

/// One of four laws.
fn law(kind: usize, stiffness: f64) -> Arc<dyn DynContactLaw> {
    let (spring, coulomb) = (
        KelvinVoigt { stiffness, damping: 1e-3 * stiffness },
        Coulomb { friction: 0.5, slip_scale: 1e-2 },
    );
    let stribeck =
        Stribeck { friction: 0.5, kinetic_friction: 0.2, stribeck_speed: 0.1, slip_scale: 1e-2 };
    match kind {
        0 => Arc::new(Law::new(spring, coulomb).unwrap()),
        1 => Arc::new(
            Law::new(spring, BristleFriction { friction: coulomb, deflection: 1e-4 }).unwrap(),
        ),
        2 => Arc::new(Law::new(spring, stribeck).unwrap()),
        _ => Arc::new(
            Law::new(HuntCrossley { stiffness, damping: 0.5, exponent: 1.5 }, coulomb).unwrap(),
        ),
    }
}

const SOFT: GapSmoothing = GapSmoothing::Softplus { width: 5e-5 };

/// Two equal bodies above each other on a floor: balls, boxes or capsules.
fn pair(
    shape: usize,
    law: &Arc<dyn DynContactLaw>,
    mass: f64,
    gravity: f64,
    apart: f64,
) -> (Model, State) {
    let mut model = Model::new(Vector3::new(0.0, 0.0, -gravity));
    let floor = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
    let rigid = RigidBody::cuboid(mass, [0.02; 3]).unwrap();
    let ball = Arc::new(Sphere { center: Point3::origin(), radius: 0.02 });
    let cuboid =
        prehend_sim::fields::Cuboid { half_extents: Vector3::repeat(0.02), rounding: 1e-3 };
    let capsule = Shape::from_parry(&Capsule::new_y(0.02, 0.02)).unwrap();
    let body = |name| {
        let body = Body::dynamic(name, rigid);
        match shape {
            0 => body.with_surface(Surface::ball(0.02).unwrap()).with_field(ball.clone()),
            1 => body.with_cuboid(cuboid, 0.02).unwrap(),
            _ => body
                .with_surface(capsule.surface().unwrap().clone())
                .with_field(capsule.field().clone()),
        }
    };
    let ids = ["lower", "upper"].map(|name| model.add(body(name)));
    model.add_symmetric_contact(ids[0], ids[1], law.clone(), SOFT).unwrap();
    for samples in ids {
        model.add_contact(ContactBodies { samples, field: floor }, law.clone(), SOFT).unwrap();
    }
    let at = |z| rigid.at_rest(&Isometry3::translation(0.0, 0.0, z));
    let states =
        State::new([BodyState::at_rest(Isometry3::identity()), at(0.02), at(0.02 + apart)]);
    (model, states)
}

#[test]
fn bodies_in_and_on_each_other_at_rest() {
    for kind in 0..4 {
        for (shape, apart) in [(0, 0.0), (0, 0.04), (1, 0.0), (1, 0.04), (2, 0.0), (2, 1e-9)] {
            let (model, states) = pair(shape, &law(kind, 1e7), 0.1, 9.81, apart);
            assert_all(&format!("law {kind}, shape {shape}, {apart} m"), &model, &states, 1e-3);
            // None of this is beyond a short step.
            let time_steps = TimeSteps { dt: 1e-5, steps: 4 };
            let run = model.simulate_with(&SemiImplicitEuler, &states, time_steps);
            assert!(run.is_ok(), "law {kind}, shape {shape}, {apart} m: {:?}", run.err());
        }
    }
}

#[test]
fn extremes_of_every_number() {
    let powers = (-12..10, -3..13, -12..1, -9..7);
    let kinds = (0..3usize, 0..4usize, any::<bool>(), prop::array::uniform3(-1.0..1.0));
    let mut runner = TestRunner::new_with_rng(
        ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() },
        prop::test_runner::TestRng::deterministic_rng(prop::test_runner::RngAlgorithm::ChaCha),
    );
    let case = (powers, kinds, -3..5);
    let run = runner.run(&case, |((mass, stiffness, time, apart), (shape, kind, falls, way), spin)| {
        let [mass, stiffness, time, apart, spin] = [mass, stiffness, time, apart, spin].map(|p: i32| 10f64.powi(p));
        let gravity = if falls { 9.81 } else { 0.0 };
        let (model, mut states) = pair(shape, &law(kind, stiffness), mass, gravity, apart);
        let way = Vector3::from(way);
        states[1].angular = way * spin;
        states[2].linear = way * spin.sqrt();
        states[2].pose.translation.vector.x = apart * way.x;
        let what = format!("{mass} kg, {stiffness} N/m³, {time} s, {apart} m, {spin} rad/s, {shape} {kind} {falls}");
        assert_all(&what, &model, &states, time);
        Ok(())
    });
    run.unwrap();
}

#[test]
fn worlds_of_nothing_and_times_of_nothing() {
    let empty = Model::new(Vector3::zeros());
    assert_all("empty", &empty, &State::new([]), 1e4);
    let mut still = empty.clone();
    let stone = RigidBody::ball(1e-12, 1e-9).unwrap();
    still.add(Body::dynamic("stone", stone));
    let rest = State::new([stone.at_rest(&Isometry3::translation(1e6, 0.0, -1e6))]);
    for time in [1e-300, 1e-12, 1e4] {
        assert_all("still", &still, &rest, time);
        assert_all("empty", &empty, &State::new([]), time);
    }
    assert_eq!(still.simulate(&rest, 0.0), Err(SimulationError::TimeStep(0.0)));
    for steps in [usize::MAX, usize::MAX / 8] {
        let long = TimeSteps { dt: 1.0, steps };
        assert_eq!(still.rollout(&rest, long).unwrap_err(), SimulationError::Memory { steps });
    }
}

#[test]
fn chains_at_their_singular_places() {
    let rod = RigidBody::cuboid(1.0, [0.01, 0.01, 0.5]).unwrap();
    let rod = rod.moved(&Isometry3::translation(0.0, 0.0, -0.5));
    let speck = RigidBody::ball(1e-12, 1e-6).unwrap();
    let axis = Vector3::y_axis();
    for (body, joint) in [
        (rod, Joint::Revolute(axis)),
        (speck, Joint::Revolute(axis)),
        (speck, Joint::Prismatic(axis)),
        (rod, Joint::Spherical),
        (speck, Joint::Floating),
    ] {
        let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
        let link = |name, joint| Link::new(name, joint, &body);
        let below = Isometry3::translation(0.0, 0.0, -1.0);
        let links = vec![link("first", joint.clone()), link("second", joint.clone()).on(0, below)];
        let first = model.add_articulation(links).unwrap()[0];
        let mut states = model.neutral_state();
        assert_all(&format!("{joint:?}"), &model, &states, 1e-2);
        if matches!(joint, Joint::Revolute(_) | Joint::Prismatic(_)) {
            let limits = JointLimits { lower: 0.0, upper: 0.0, stiffness: 1e3, damping: 1.0 };
            model.add_joint_force(first, limits).unwrap();
            model
                .add_joint_force(first, JointFriction { friction: 1.0, velocity_scale: 1e-2 })
                .unwrap();
            model.add_joint_force(first, JointSpring { stiffness: 1e12, rest: 0.0 }).unwrap();
            assert_all(&format!("laws along {joint:?}"), &model, &states, 1e-2);
            model.set_joint(&mut states, first, &[0.3], &[1e4]).unwrap();
            assert_all(&format!("fast {joint:?}"), &model, &states, 1e-3);
        }
    }
    let mut model = Model::new(Vector3::zeros());
    let links = model.add_articulation(vec![Link::new("ball", Joint::Spherical, &rod)]).unwrap();
    let mut states = model.neutral_state();
    let error = model.set_joint(&mut states, links[0], &[0.0; 4], &[0.0; 3]).unwrap_err();
    assert_eq!(error, SimulationError::Rotation { body: "ball".to_owned(), norm: 0.0 });
    let pin = Link { mass: 1.0, ..Link::massless("pin", Joint::Revolute(axis)) };
    let inverse = Link { inertia: -Matrix3::identity(), ..pin.clone() };
    for link in [pin, inverse] {
        assert!(Articulation::new(vec![link], Vector3::z()).is_err());
    }
}

#[test]
fn dynamics_of_chains_of_all_sizes() {
    let rod = RigidBody::cuboid(1.0, [0.01, 0.01, 0.5]).unwrap();
    let speck = RigidBody::ball(1e-12, 1e-6).unwrap();
    let sizes = [0.0, 1e-300, 1e-9, 1.0, PI, 1e6];
    for (body, joint) in [
        (rod, Joint::Revolute(Vector3::y_axis())),
        (speck, Joint::Revolute(Vector3::y_axis())),
        (speck, Joint::Prismatic(Vector3::x_axis())),
    ] {
        let link = |name| Link::new(name, joint.clone(), &body);
        let below = Isometry3::translation(0.0, 0.0, -1.0);
        let links = vec![link("first"), link("second").on(0, below), link("third").on(1, below)];
        let tree = Articulation::new(links, Vector3::new(0.0, 0.0, -9.81)).unwrap();
        for (q, v) in sizes.into_iter().flat_map(|q| sizes.map(|v| (q, v))) {
            let at = tree.kinematics(&[q, -q, q], &[v, v, -v]);
            let accelerations = at.forward_dynamics(&[v, 0.0, -1.0]);
            let efforts = at.inverse_dynamics(accelerations.as_slice());
            let by = at.inverse_dynamics_derivatives(accelerations.as_slice());
            let slopes = by.by_position.iter().chain(&by.by_velocity).chain(&by.by_acceleration);
            let matrix = at.mass_matrix();
            let all = accelerations.iter().chain(&efforts).chain(&matrix).chain(slopes);
            assert!({ all }.all(|x| x.is_finite()), "{joint:?} at {q}, {v}");
            let forward = at.forward_dynamics_derivatives(&accelerations).unwrap();
            let slopes = forward.by_position.iter().chain(&forward.by_velocity);
            assert!({ slopes }.all(|x| x.is_finite()), "{joint:?} at {q}, {v}");
        }
    }
}

#[test]
fn laws_of_all_sizes() {
    let spring = KelvinVoigt { stiffness: 1e7, damping: 1e4 };
    for x in [0.0, 1e-300, 1e-100, 1e-60, 1e-9, 1e6, 1e60, 1e150] {
        let coulomb = Coulomb { friction: 0.5, slip_scale: x };
        let held =
            BristleFriction { friction: Coulomb { slip_scale: 1e-2, ..coulomb }, deflection: x };
        let laws: [Option<Arc<dyn DynContactLaw>>; 2] = [
            Law::new(spring, coulomb).ok().map(|law| Arc::new(law) as _),
            Law::new(spring, held).ok().map(|law| Arc::new(law) as _),
        ];
        for law in laws.iter().flatten() {
            let (model, states) = pair(0, law, 0.1, 9.81, 0.039);
            assert_all(&format!("parameter {x}"), &model, &states, 1e-3);
        }
        let target =
            ContactCalibration { mass: 0.3, gravity: 9.81, penetration: x, contact_area: x };
        if let Ok(KelvinVoigt { stiffness, damping }) = KelvinVoigt::from_target(&target, 0.5) {
            assert!(stiffness.is_finite() && damping.is_finite());
        }
    }
}
