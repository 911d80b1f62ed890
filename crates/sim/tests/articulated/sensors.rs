//! Sensors against differences of the motion.

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_sim::articulated::{Joint, Link};
use prehend_sim::{Body, RigidBody, State, World};

#[test]
fn an_accelerometer_shows_the_motion_less_free_fall() {
    let mut world = World::new(Vector3::new(0.0, 0.0, -9.81));
    let rigid = RigidBody::cuboid(1.0, [0.1, 0.05, 0.2]).unwrap();
    let place = |x: f64| Isometry3::new(Vector3::new(x, 0.1, 0.3), Vector3::new(0.2, x, -0.3));
    let links = vec![
        Link::new("base", Joint::Floating, &rigid).at(place(0.0)),
        Link::new("arm", Joint::Spherical, &rigid).on(0, place(0.2)),
        Link::new("hand", Joint::Revolute(Vector3::x_axis()), &rigid).on(1, place(-0.3)),
    ];
    let bodies = world.add_articulation(links).unwrap();
    let stone = world.add(Body::free("stone", rigid));
    world.bodies[stone].external_wrench.x = 2.0;
    world.bodies[bodies[2]].external_wrench.y = 3.0;
    let mut states = world.neutral_states();
    states[stone].angular = Vector3::new(3.0, 1.0, -2.0);
    let q = [0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0];
    world.set_joint(&mut states, bodies[0], &q, &[0.4, 0.1, -0.2, 1.0, -2.0, 0.5]).unwrap();
    world.set_joint(&mut states, bodies[1], &[0.0, 0.6, 0.0, 0.8], &[1.0, -1.0, 3.0]).unwrap();
    world.set_joint(&mut states, bodies[2], &[0.4], &[-4.0]).unwrap();
    let point = Point3::new(0.03, -0.02, 0.1);
    let time = 1e-4;
    let run = [time, 2.0 * time].map(|time| world.simulate(&states, time).unwrap());
    for body in [stone, bodies[0], bodies[1], bodies[2]] {
        let place = |states: &[State]| (states[body].pose * point).coords;
        let velocity = |states: &[State]| {
            let state = &states[body];
            state.linear + state.angular.cross(&(state.pose.rotation * point.coords))
        };
        let rate = (velocity(&run[1]) - velocity(&states)) / (2.0 * time);
        let felt = world.accelerometer(body, &point, &run[0]).unwrap();
        let expected = run[0][body].pose.rotation.inverse() * (rate - world.gravity);
        assert!((felt - expected).norm() < 1e-4 * expected.norm(), "{felt} {expected}");
        let moved = (place(&run[1]) - place(&states)) / (2.0 * time);
        assert!((moved - velocity(&run[0])).norm() < 1e-5);
    }
    assert!(world.accelerometer(stone, &point, &states[..2]).is_err());
}
