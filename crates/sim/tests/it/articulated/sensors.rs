//! Sensors against differences of the motion.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_sim::articulated::{Joint, Link};
use prehend_sim::fields::HalfSpace;
use prehend_sim::joint_law::JointDamper;
use prehend_sim::{Body, ContactBodies, Model, RigidBody, State, Surface};

use super::scenes::coulomb_law;

#[test]
fn an_accelerometer_shows_the_motion_less_free_fall() {
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    let rigid = RigidBody::cuboid(1.0, [0.1, 0.05, 0.2]).unwrap();
    let place = |x: f64| Isometry3::new(Vector3::new(x, 0.1, 0.3), Vector3::new(0.2, x, -0.3));
    let links = vec![
        Link::new("base", Joint::Floating, &rigid).at(place(0.0)),
        Link::new("arm", Joint::Spherical, &rigid).on(0, place(0.2)),
        Link::new("hand", Joint::Revolute(Vector3::x_axis()), &rigid).on(1, place(-0.3)),
    ];
    let bodies = model.add_articulation(links).unwrap();
    let stone = model.add(Body::dynamic("stone", rigid));
    model.bodies[stone].external_wrench.x = 2.0;
    model.bodies[bodies[2]].external_wrench.y = 3.0;
    let mut states = model.neutral_state();
    states[stone].angular = Vector3::new(3.0, 1.0, -2.0);
    let q = [0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0];
    model.set_joint(&mut states, bodies[0], &q, &[0.4, 0.1, -0.2, 1.0, -2.0, 0.5]).unwrap();
    model.set_joint(&mut states, bodies[1], &[0.0, 0.6, 0.0, 0.8], &[1.0, -1.0, 3.0]).unwrap();
    model.set_joint(&mut states, bodies[2], &[0.4], &[-4.0]).unwrap();
    let point = Point3::new(0.03, -0.02, 0.1);
    let time = 1e-4;
    let run = [time, 2.0 * time].map(|time| model.simulate(&states, time).unwrap());
    for body in [stone, bodies[0], bodies[1], bodies[2]] {
        let place = |states: &State| (states[body].pose * point).coords;
        let velocity = |states: &State| {
            let state = &states[body];
            state.linear + state.angular.cross(&(state.pose.rotation * point.coords))
        };
        let rate = (velocity(&run[1]) - velocity(&states)) / (2.0 * time);
        let felt = model.accelerometer(body, &point, &run[0]).unwrap();
        let expected = run[0][body].pose.rotation.inverse() * (rate - model.gravity);
        assert!((felt - expected).norm() < 1e-4 * expected.norm(), "{felt} {expected}");
        let moved = (place(&run[1]) - place(&states)) / (2.0 * time);
        assert!((moved - velocity(&run[0])).norm() < 1e-5);
    }
    assert!(model.accelerometer(stone, &point, &State::new(&states.bodies()[..2])).is_err());
}

#[test]
fn a_link_at_rest_feels_the_floor_that_carries_it() {
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    let floor = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
    let rigid = RigidBody::ball(0.4, 0.05).unwrap();
    let slide = Joint::Prismatic(Vector3::z_axis());
    let place = Isometry3::new(Vector3::new(0.3, 0.0, 0.05), Vector3::z() * 0.5);
    let links = vec![Link::new("foot", slide, &rigid).at(place)];
    let foot = model.add_articulation(links).unwrap()[0];
    // The ball that touches is beside the link's origin, which the slide does not let tip.
    let aside = Isometry3::translation(0.07, 0.0, 0.0);
    let ball = Surface::ball(0.05).unwrap().moved(&aside);
    model.bodies[foot].surface = Some(Arc::new(ball));
    let (law, smoothing) = coulomb_law();
    model.add_contact(ContactBodies { samples: foot, field: floor }, law, smoothing).unwrap();
    model.add_joint_force(foot, JointDamper { damping: 20.0 }).unwrap();
    let end = model.simulate(&model.neutral_state(), 2.0).unwrap();
    let wrench = model.contact_wrench(foot, &end).unwrap();
    let weight = 0.4 * 9.81;
    let arm = place.rotation * aside.translation.vector;
    let torque = arm.cross(&Vector3::new(0.0, 0.0, weight));
    let expected = [0.0, 0.0, weight, torque.x, torque.y, 0.0];
    for (found, expected) in wrench.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-4, "{wrench}");
    }
    // The floor feels the opposite, about its own origin.
    let below = model.contact_wrench(floor, &end).unwrap();
    assert!((below.z + weight).abs() < 1e-4, "{below}");
    // An external force on the link is no contact.
    model.bodies[foot].external_wrench.x = 5.0;
    assert!(model.contact_wrench(foot, &end).unwrap().x.abs() < 1e-4);
}
