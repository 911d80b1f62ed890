//! Canonical contact problems with closed-form solutions.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use crate::contact::restitution::restitution;
use crate::contact::stiffness::{damping_per_area, stiffness_per_area};
use crate::scenes::floor;
use crate::{Body, Horizon, Onset, Penalty, RigidBody, SemiImplicitEuler, State, Surface, World};

const G: f64 = 9.81;
const MASS: f64 = 0.3;

/// Four feet in the plane of the centre of mass, so that friction tips nothing.
fn slab(law: &Penalty, gravity: Vector3<f64>) -> World {
    let rigid = RigidBody::new(MASS, Matrix3::identity() * 1e-3, Point3::origin()).unwrap();
    let feet = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
    let feet = feet.map(|(x, y)| Point3::new(0.05 * x, 0.05 * y, 0.0));
    let mut world = World::new(gravity);
    let ground = world.add(Body::held("ground").with_field(floor()));
    let surface = Surface::new(&feet, &[1e-4; 4]).unwrap();
    let slab = world.add(Body::free("slab", rigid).with_surface(surface));
    world.touch(slab, ground, Arc::new(*law), Onset::Hard).unwrap();
    world
}

fn run(law: &Penalty, gravity: Vector3<f64>, start: State, dt: f64, steps: usize) -> Vec<State> {
    let ground = State::at_rest(Isometry3::identity());
    let world = slab(law, gravity);
    let states =
        world.rollout(&SemiImplicitEuler, &[ground, start], Horizon { dt, steps }).unwrap();
    states.iter().map(|states| states[1]).collect()
}

fn at(height: f64, linear: Vector3<f64>) -> State {
    let pose = Isometry3::translation(0.0, 0.0, height);
    State { pose, linear, angular: Vector3::zeros() }
}

#[test]
fn a_resting_body_sinks_in_by_its_weight() {
    let (penetration, area) = (5e-4, 4e-4);
    let stiffness = stiffness_per_area(MASS, G, penetration, area);
    let damping = damping_per_area(MASS, stiffness, area, 0.7);
    let law = Penalty::new(stiffness, damping, 0.5, 1e-3).unwrap();
    let end = *run(&law, Vector3::new(0.0, 0.0, -G), at(0.0, Vector3::zeros()), 1e-4, 10_000)
        .last()
        .unwrap();
    assert!((end.pose.translation.z + penetration).abs() < 1e-12);
    assert!((area * stiffness * -end.pose.translation.z - MASS * G).abs() < 1e-9);
    assert!(end.linear.norm() < 1e-10);
}

#[test]
fn restitution_of_the_clamped_kelvin_voigt_contact() {
    let (area, stiffness) = (4e-4, 1e7);
    let period = 2.0 * std::f64::consts::PI / (stiffness * area / MASS).sqrt();
    for ratio in [0.1, 0.3, 0.5, 0.8] {
        let damping = damping_per_area(MASS, stiffness, area, ratio);
        let law = Penalty::new(stiffness, damping, 0.0, 1e-3).unwrap();
        let dt = period / 20_000.0;
        let start = at(0.0, Vector3::new(0.0, 0.0, -1.0));
        let end = *run(&law, Vector3::zeros(), start, dt, 20_000).last().unwrap();
        assert!(end.pose.translation.z > 0.0, "still in contact");
        assert!((end.linear.z - restitution(ratio)).abs() < 1e-3, "{ratio}: {}", end.linear.z);
    }
}

/// Gravity of an incline of angle `theta`, seen from the incline.
fn incline(theta: f64) -> Vector3<f64> {
    Vector3::new(G * theta.sin(), 0.0, -G * theta.cos())
}

/// A law at rest on the incline, with the height at which it carries the body.
fn settled(theta: f64, friction: f64, slip_scale: f64) -> (Penalty, f64) {
    let (area, penetration) = (4e-4, 5e-4);
    let stiffness = stiffness_per_area(MASS, G * theta.cos(), penetration, area);
    let damping = damping_per_area(MASS, stiffness, area, 1.0);
    (Penalty::new(stiffness, damping, friction, slip_scale).unwrap(), -penetration)
}

#[test]
fn below_the_friction_angle_a_body_creeps() {
    let (friction, slip_scale, theta) = (0.5, 1e-2, 20f64.to_radians());
    let (law, height) = settled(theta, friction, slip_scale);
    let end =
        *run(&law, incline(theta), at(height, Vector3::zeros()), 1e-4, 10_000).last().unwrap();
    let tan = theta.tan();
    let creep = slip_scale * tan / (friction * friction - tan * tan).sqrt();
    assert!((end.linear.x / creep - 1.0).abs() < 1e-6, "{} {creep}", end.linear.x);
}

#[test]
fn above_the_friction_angle_a_body_accelerates() {
    let (friction, theta) = (0.5, 40f64.to_radians());
    let (law, height) = settled(theta, friction, 1e-5);
    let states = run(&law, incline(theta), at(height, Vector3::zeros()), 1e-4, 10_000);
    let expected = G * (theta.sin() - friction * theta.cos());
    // Between two moments of steady slip: friction misses the first step, which starts at rest.
    let measured = (states[10_000].linear.x - states[5_000].linear.x) / 0.5;
    assert!((measured / expected - 1.0).abs() < 1e-6, "{measured} {expected}");
}

#[test]
fn a_sliding_body_stops_after_its_stopping_distance() {
    let (friction, speed) = (0.4, 1.0);
    let (law, height) = settled(0.0, friction, 1e-5);
    let start = at(height, Vector3::new(speed, 0.0, 0.0));
    let end = *run(&law, Vector3::new(0.0, 0.0, -G), start, 1e-5, 40_000).last().unwrap();
    let distance = speed * speed / (2.0 * friction * G);
    assert!((end.pose.translation.x / distance - 1.0).abs() < 1e-3);
    assert!(end.linear.norm() < 1e-4);
}

#[test]
fn undamped_contact_is_stable_below_two_and_not_above() {
    let (area, stiffness) = (4e-4, 1e7);
    let omega = f64::sqrt(stiffness * area / MASS);
    let law = Penalty::new(stiffness, 0.0, 0.0, 1e-3).unwrap();
    let rest = -G / (omega * omega);
    // Started just off equilibrium under gravity, so that contact never breaks while stable.
    let amplitude = |product: f64| {
        let start = at(1.01 * rest, Vector3::zeros());
        let states = run(&law, Vector3::new(0.0, 0.0, -G), start, product / omega, 400);
        states.iter().map(|s| (s.pose.translation.z - rest).abs()).fold(0.0, f64::max)
    };
    assert!(amplitude(1.9) < -0.1 * rest);
    assert!(amplitude(2.05) > -0.5 * rest);
}
