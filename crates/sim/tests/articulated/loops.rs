//! Welds and the loops that they close.

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_sim::articulated::{Joint, Link};
use prehend_sim::{Body, BodyId, RigidBody, State, TimeSteps, Weld, WeldStiffness, World};

#[test]
fn a_welded_ball_is_an_oscillator() {
    let mut world = World::new(Vector3::zeros());
    let rigid = RigidBody::ball(0.5, 0.1).unwrap();
    let (post, ball) = (world.add(Body::kinematic("post")), world.add(Body::free("ball", rigid)));
    let stiffness =
        WeldStiffness { linear: 50.0, linear_damping: 0.0, angular: 0.2, angular_damping: 0.0 };
    let frames = [Isometry3::identity(); 2];
    world.add_weld(Weld { bodies: [ball, post], frames, stiffness }).unwrap();
    let turn = Vector3::new(0.0, 0.0, 0.3);
    let mut states = world.neutral_states();
    states[ball] = State::at_rest(Isometry3::new(Vector3::new(0.02, 0.0, 0.0), turn));
    let end = world.simulate(&states, 0.2).unwrap();
    let expected = 0.02 * (10.0_f64 * 0.2).cos();
    assert!((end[ball].pose.translation.x - expected).abs() < 1e-6);
    let inertia = 0.4 * 0.5 * 0.01;
    let expected = 0.3 * ((0.2_f64 / inertia).sqrt() * 0.2).cos();
    assert!((end[ball].pose.rotation.scaled_axis().z - expected).abs() < 1e-5);
}

/// A parallelogram: two rods of 1 m hang from the ceiling, and a third is welded between their ends by ball joints.
fn parallelogram() -> (World, [BodyId; 2]) {
    let mut world = World::new(Vector3::new(0.0, 0.0, -9.81));
    let rod = RigidBody::cuboid(1.0, [0.02, 0.02, 0.5]).unwrap();
    let down = RigidBody::new(1.0, *rod.inertia(), Point3::new(0.0, 0.0, -0.5)).unwrap();
    let across = RigidBody::cuboid(1.0, [0.5, 0.02, 0.02]).unwrap();
    let hinge = |name, body: &RigidBody| Link::new(name, Joint::Revolute(Vector3::y_axis()), body);
    let across = RigidBody::new(1.0, *across.inertia(), Point3::new(0.5, 0.0, 0.0)).unwrap();
    let links = vec![
        hinge("left", &down),
        hinge("right", &down).at(Isometry3::translation(1.0, 0.0, 0.0)),
        hinge("coupler", &across).on(0, Isometry3::translation(0.0, 0.0, -1.0)),
    ];
    let bodies = world.add_articulation(links).unwrap();
    let frames = [Isometry3::translation(1.0, 0.0, 0.0), Isometry3::translation(0.0, 0.0, -1.0)];
    let stiffness = WeldStiffness::critical(1.0, 0.0, 2e-3);
    world.add_weld(Weld { bodies: [bodies[2], bodies[1]], frames, stiffness }).unwrap();
    (world, [bodies[0], bodies[1]])
}

#[test]
fn a_parallelogram_swings_as_its_equation_says() {
    let (world, [left, right]) = parallelogram();
    let mut states = world.neutral_states();
    let angle = 0.5;
    for (link, angle) in
        [(left, angle), (right, angle), (world.articulations[0].bodies()[2], -angle)]
    {
        world.set_joint(&mut states, link, &[angle], &[0.0]).unwrap();
    }
    let run = world.rollout(&states, TimeSteps { dt: 0.1, steps: 10 }).unwrap();
    // Rods turn about their ends and the coupler only moves: I θ'' = −(2 m l/2 + m l) g sin θ.
    let rod = (4e-4 + 0.25) / 3.0 + 0.25;
    let rate = 2.0 * 9.81 / (2.0 * rod + 1.0);
    let (mut theta, mut speed) = (angle, 0.0_f64);
    for states in &run[1..] {
        for _ in 0..10_000 {
            speed -= rate * theta.sin() * 1e-5;
            theta += speed * 1e-5;
        }
        let [a, b] = [left, right].map(|link| world.joint(states, link).unwrap().position[0]);
        assert!((a - theta).abs() < 1e-3 && (b - theta).abs() < 1e-3, "{a} {b} {theta}");
    }
}
