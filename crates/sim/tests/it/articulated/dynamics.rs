//! Mass matrix, accelerations, energy and momentum of a state, against one another and against differences.

use nalgebra::{DVector, Isometry3, Matrix3, Point3, Vector3};
use prehend_geometry::SplitMix64;
use prehend_sim::{Body, Model, RigidBody, RungeKutta4, SemiImplicitEuler, State, Step, TimeSteps};

use super::scenes::{random_link, random_scene};

fn velocity(model: &Model, state: &State) -> DVector<f64> {
    DVector::from_vec(model.generalized_coordinates(state).velocity)
}

#[test]
fn accelerations_are_rates_of_velocities() {
    let dt = 1e-7;
    for seed in 0..40 {
        let (model, mut state) = random_scene(seed);
        let free = model.body_named("ball").unwrap();
        state[free].angular = Vector3::new(1.0, -2.0, 0.5);
        let expected = model.accelerations(&state).unwrap();
        let next = model.step(&SemiImplicitEuler, &state, Step::new(0, dt)).unwrap();
        let found = (velocity(&model, &next) - velocity(&model, &state)) / dt;
        let scale = 1.0 + expected.amax();
        assert!((&found - &expected).amax() < 1e-5 * scale, "{seed}: {found} {expected}");
    }
}

/// A tree of twelve links, the first of which floats, and a free body whose center of mass is not its origin: nothing touches.
fn floating(gravity: Vector3<f64>) -> (Model, State) {
    let mut random = SplitMix64::new(3);
    let mut model = Model::new(gravity);
    let root = Matrix3::new(0.03, 0.01, 0.0, 0.0, 0.02, 0.01, 0.01, 0.0, 0.04);
    let inertia = root * root.transpose() + Matrix3::identity() * 1e-3;
    let body = RigidBody::new(0.7, inertia, Point3::new(0.02, -0.01, 0.03)).unwrap();
    let free = model.add(Body::dynamic("free", body));
    let links = (0..12).map(|index| {
        let link = random_link(&mut random, index, true);
        // Rotors turn without a momentum of their own in this model.
        prehend_sim::articulated::Link { armature: 0.0, ..link }
    });
    let bodies = model.add_articulation(links.collect()).unwrap();
    let mut state = model.neutral_state();
    let at = Isometry3::new(Vector3::new(0.3, -1.0, 0.2), Vector3::new(0.4, 0.2, -0.9));
    model.set_pose(&mut state, free, &at).unwrap();
    state[free].linear = Vector3::new(0.3, 0.1, -0.2);
    state[free].angular = Vector3::new(-2.0, 1.0, 3.0);
    for link in bodies {
        let mut joint = model.joint(&state, link).unwrap();
        joint.velocity.iter_mut().for_each(|v| *v = random.normal());
        model.set_joint(&mut state, link, &joint.position, &joint.velocity).unwrap();
    }
    (model, state)
}

#[test]
fn energy_is_that_of_each_body() {
    let (model, state) = floating(Vector3::new(0.3, -0.1, -9.81));
    let [mut kinetic, mut potential] = [0.0; 2];
    let mut add = |mass: f64, inertia: Matrix3<f64>, com: Vector3<f64>, v: Vector3<f64>, w| {
        kinetic += 0.5 * mass * v.norm_squared() + 0.5 * Vector3::dot(&w, &(inertia * w));
        potential -= mass * model.gravity.dot(&com);
    };
    for id in model.body_ids() {
        let at = &state[id];
        let turn = at.pose.rotation.to_rotation_matrix();
        match model.bodies[id].rigid() {
            Some(body) => {
                let inertia = body.world_inertia(&at.pose.rotation);
                add(body.mass(), inertia, at.pose.translation.vector, at.linear, at.angular);
            }
            None => {
                let links = model.articulations[0].tree.links();
                let link = links.iter().find(|link| link.name == model.bodies[id].name).unwrap();
                let arm = at.pose.rotation * link.com.coords;
                let inertia = turn.matrix() * link.inertia * turn.matrix().transpose();
                let com = at.pose.translation.vector + arm;
                add(link.mass, inertia, com, at.linear + at.angular.cross(&arm), at.angular);
            }
        }
    }
    let found = model.energy(&state).unwrap();
    assert!((found.kinetic - kinetic).abs() < 1e-12 * kinetic, "{found:?} {kinetic}");
    assert!((found.potential - potential).abs() < 1e-12, "{found:?} {potential}");
    // Links carry rotors, too, as inertia along their joints.
    let (model, state) = random_scene(4);
    let v = velocity(&model, &state);
    let mass = model.mass_matrix(&state).unwrap();
    assert!((&mass - mass.transpose()).amax() < 1e-14 && mass.clone().cholesky().is_some());
    let kinetic = 0.5 * v.dot(&(mass * &v));
    assert!((model.energy(&state).unwrap().kinetic - kinetic).abs() < 1e-14);
}

#[test]
fn momentum_is_kept_without_gravity_and_grows_by_the_weight_with_it() {
    let time_steps = TimeSteps { dt: 5e-4, steps: 400 };
    for gravity in [Vector3::zeros(), Vector3::new(0.3, -0.1, -9.81)] {
        let (model, start) = floating(gravity);
        let end = model.simulate_with(&RungeKutta4, &start, time_steps).unwrap().states;
        let [before, after] = [&start, &end].map(|state| model.momentum(state).unwrap());
        let links: f64 = model.articulations[0].tree.links().iter().map(|link| link.mass).sum();
        let force = gravity * (links + 0.7);
        let change = after - before;
        let linear = change.fixed_rows::<3>(0) - force * 0.2;
        assert!(linear.amax() < 1e-8, "{linear}");
        if force.norm() == 0.0 {
            assert!(change.amax() < 1e-8, "{change}");
        }
        let [before, after] = [&start, &end].map(|state| model.energy(state).unwrap());
        let [before, after] = [before, after].map(|energy| energy.kinetic + energy.potential);
        assert!((before - after).abs() < 1e-7, "{before} {after}");
    }
}

#[test]
fn states_of_other_models_are_refused() {
    let (model, _) = random_scene(1);
    let other = State::new([]);
    assert!(model.mass_matrix(&other).is_err() && model.momentum(&other).is_err());
    assert!(model.accelerations(&other).is_err());
}
