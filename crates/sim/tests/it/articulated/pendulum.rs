//! Against closed forms.

use nalgebra::{Isometry3, Vector3};
use prehend_sim::articulated::{Joint, Link};
use prehend_sim::joint_law::{JointDamper, JointLimits, JointSpring};
use prehend_sim::{
    Adaptive, BodyId, Integrator, Model, RigidBody, RungeKutta4, SemiImplicitEuler, State,
    TimeSteps,
};

const GRAVITY: f64 = 9.81;

/// A ball of 1 kg on a rod of 1 m that turns about y.
fn pendulum() -> (Model, BodyId, f64) {
    let mut model = Model::new(Vector3::new(0.0, 0.0, -GRAVITY));
    let ball = RigidBody::ball(1.0, 0.1).unwrap();
    let (inertia, com) = (*ball.inertia(), nalgebra::Point3::new(0.0, 0.0, -1.0));
    let ball = RigidBody::new(1.0, inertia, com).unwrap();
    let hinge = Joint::Revolute(Vector3::y_axis());
    let link = Link::new("rod", hinge, &ball).at(Isometry3::translation(0.0, 0.0, 2.0));
    let rod = model.add_articulation(vec![link]).unwrap()[0];
    (model, rod, 1.0 + inertia.m11)
}

fn start(model: &Model, link: BodyId, angle: f64, speed: f64) -> State {
    let mut states = model.neutral_state();
    model.set_joint(&mut states, link, &[angle], &[speed]).unwrap();
    states
}

#[test]
fn a_pendulum_has_its_period() {
    let (model, rod, inertia) = pendulum();
    let angle: f64 = 2.0;
    // 4 K(sin(θ/2)) √(I / m g l) by the arithmetic-geometric mean.
    let (mut a, mut b) = (1.0, (0.5 * angle).cos());
    for _ in 0..20 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    let period = 2.0 * std::f64::consts::PI / a * (inertia / GRAVITY).sqrt();
    let end = model.simulate(&start(&model, rod, angle, 0.0), period).unwrap();
    let joint = model.joint(&end, rod).unwrap();
    assert!((joint.position[0] - angle).abs() < 1e-4, "{joint:?}");
    assert!(joint.velocity[0].abs() < 1e-3, "{joint:?}");
    // The link is where the joint puts it.
    let place = end[rod].pose * nalgebra::Point3::new(0.0, 0.0, -1.0);
    assert!((place.x + joint.position[0].sin()).abs() < 1e-12);
    assert!((place.z - 2.0 + joint.position[0].cos()).abs() < 1e-12);
}

#[test]
fn energy_is_kept_to_the_order_of_the_integrator() {
    fn lost(integrator: &impl Integrator, steps: usize) -> f64 {
        let (model, rod, inertia) = pendulum();
        let time_steps = TimeSteps { dt: 1.0 / steps as f64, steps };
        let initial = start(&model, rod, 1.5, 0.3);
        let end = model.simulate_with(integrator, &initial, time_steps).unwrap().states;
        let energy = |states: &State| {
            let joint = model.joint(states, rod).unwrap();
            0.5 * inertia * joint.velocity[0].powi(2) - GRAVITY * joint.position[0].cos()
        };
        (energy(&end) - energy(&initial)).abs()
    }
    let ratio = lost(&SemiImplicitEuler, 200) / lost(&SemiImplicitEuler, 400);
    assert!((ratio - 2.0).abs() < 0.2, "{ratio}");
    let ratio = lost(&RungeKutta4, 40) / lost(&RungeKutta4, 80);
    assert!(ratio > 14.0 && ratio < 36.0, "{ratio}");
    assert!(lost(&Adaptive::default(), 1) < 1e-3);
}

#[test]
fn a_spring_and_a_damper_are_an_oscillator() {
    let (mut model, rod, inertia) = pendulum();
    model.gravity = Vector3::zeros();
    let (stiffness, damping, rest) = (30.0, 2.0, 0.4);
    model.add_joint_force(rod, JointSpring { stiffness, rest }).unwrap();
    model.add_joint_force(rod, JointDamper { damping }).unwrap();
    let time = 0.7;
    let end = model.simulate(&start(&model, rod, 1.0, 0.0), time).unwrap();
    let rate = 0.5 * damping / inertia;
    let omega = (stiffness / inertia - rate * rate).sqrt();
    let wave = (omega * time).cos() + rate / omega * (omega * time).sin();
    let expected = rest + (1.0 - rest) * (-rate * time).exp() * wave;
    let found = model.joint(&end, rod).unwrap().position[0];
    assert!((found - expected).abs() < 1e-5, "{found} {expected}");
}

#[test]
fn a_limit_stops_a_joint() {
    let (mut model, rod, _) = pendulum();
    let limits = JointLimits { lower: -0.2, upper: 3.0, stiffness: 1e4, damping: 1.0 };
    model.add_joint_force(rod, limits).unwrap();
    let time_steps = TimeSteps { dt: 1e-2, steps: 300 };
    let run = model.rollout(&start(&model, rod, 1.0, 0.0), time_steps).unwrap();
    let angles = run.iter().map(|state| model.joint(state, rod).unwrap().position[0]);
    let lowest = angles.fold(f64::INFINITY, f64::min);
    // ½ k d² is no more than the fall.
    assert!(lowest < -0.2 && lowest > -0.25, "{lowest}");
}
