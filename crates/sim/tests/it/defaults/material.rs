//! Contacts of all bodies by the default material.

use nalgebra::{Vector3, Vector6};
use prehend_sim::model::PointContact;
use prehend_sim::{Body, BodyId, Material, Model, Shape, State};

/// A floor across z, and a body of `shape` at `height` above it \[m\].
fn above_floor(gravity: Vector3<f64>, shape: &Shape, height: f64) -> (Model, State) {
    let mut model = Model::new(gravity);
    let floor = Shape::half_space(Vector3::z_axis()).unwrap();
    model.add(Body::fixed_from_shape("floor", &floor));
    let body = model.add(Body::from_shape("body", shape, 500.0).unwrap());
    let mut states = model.neutral_state();
    states[body].pose.translation.z = height;
    (model, states)
}

#[test]
fn a_box_holds_on_a_ramp() {
    let slope = 20.0_f64.to_radians();
    let gravity = Vector3::new(slope.sin(), 0.0, -slope.cos()) * 9.81;
    let (mut model, states) = above_floor(gravity, &Shape::cuboid([0.05; 3]).unwrap(), 0.05);
    model.add_contacts(Material::default()).unwrap();
    let moved = model.simulate(&states, 10.0).unwrap()[1].pose.translation.vector;
    assert!((moved - Vector3::new(0.0, 0.0, 0.05)).norm() < 1e-3, "{moved}");
    // Beyond the angle of friction it slides with (sin − µ cos) g.
    let material = Material { friction: 0.2, ..Material::default() };
    let (mut model, states) = above_floor(gravity, &Shape::cuboid([0.05; 3]).unwrap(), 0.05);
    model.add_contacts(material).unwrap();
    let slid = model.simulate(&states, 1.0).unwrap()[1].pose.translation.x;
    let expected = 0.5 * 9.81 * (slope.sin() - 0.2 * slope.cos());
    assert!((slid / expected - 1.0).abs() < 1e-2, "{slid} of {expected}");
}

#[test]
fn a_ball_bounces_by_its_restitution() {
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let (mut model, states) = above_floor(gravity, &Shape::ball(0.03).unwrap(), 1.03);
    model.add_contacts(Material { restitution: 0.6, ..Material::default() }).unwrap();
    let end = model.simulate(&states, 0.6).unwrap()[1];
    let height = end.pose.translation.z - 0.03 + end.linear.z.powi(2) / (2.0 * 9.81);
    assert!(end.linear.z > 0.0 && (height / 0.36 - 1.0).abs() < 1e-2, "{height}");
}

#[test]
fn what_cannot_touch_is_told() {
    let mut model = Model::new(Vector3::zeros());
    model.add(Body::fixed_from_shape("floor", &Shape::half_space(Vector3::z_axis()).unwrap()));
    let alone = model.add_contacts(Material::default()).unwrap_err().to_string();
    assert_eq!(alone, "no two of these bodies can move against each other");
    let (mut model, _) = above_floor(Vector3::zeros(), &Shape::ball(0.03).unwrap(), 1.0);
    let bad = Material { restitution: 0.0, ..Material::default() };
    assert!(model.add_contacts(bad).unwrap_err().to_string().contains("restitution"));
}

/// Wrench on a body by its points about its center of mass at rest.
fn sum(points: &[PointContact], states: &State, body: BodyId) -> Vector6<f64> {
    let center = states[body].pose.translation.vector;
    points.iter().fold(Vector6::zeros(), |sum, point| {
        let force = match (point.bodies.samples == body, point.bodies.field == body) {
            (true, _) => point.force,
            (_, true) => -point.force,
            _ => return sum,
        };
        let torque = (point.position.coords - center).cross(&force);
        sum + Vector6::from_iterator(force.iter().chain(&torque).copied())
    })
}

#[test]
fn forces_of_points_add_up_to_the_wrench_of_their_body() {
    let slope = 10.0_f64.to_radians();
    let gravity = Vector3::new(slope.sin(), 0.0, -slope.cos()) * 9.81;
    let cube = Shape::cuboid([0.05; 3]).unwrap();
    let (mut model, mut states) = above_floor(gravity, &cube, 0.05);
    // Bodies whose frame and center of mass differ, and that touch each other with samples of both.
    let ball = model.add(Body::from_shape("ball", &Shape::ball(0.02).unwrap(), 500.0).unwrap());
    let upper = model.add(Body::from_shape("upper", &cube, 500.0).unwrap());
    let joined = model.neutral_state();
    let lower = states[1];
    states = joined;
    states[1] = lower;
    states[ball].pose.translation.vector = Vector3::new(0.2, 0.0, 0.0199);
    states[upper].pose.translation.vector = Vector3::new(0.01, 0.02, 0.1499);
    model.add_contacts(Material::default()).unwrap();
    let states = model.simulate(&states, 0.2).unwrap();
    let points = model.point_contacts(&states).unwrap();
    assert!(points.iter().all(|point| (point.normal.norm() - 1.0).abs() < 1e-12));
    assert!(points.iter().any(|point| point.gap < 0.0 && point.position.z.abs() < 1e-3));
    for body in model.body_ids().skip(1) {
        let (own, whole) =
            (sum(&points, &states, body), model.contact_wrench(body, &states).unwrap());
        assert!(whole.norm() > 0.1 && (own - whole).norm() < 1e-9 * whole.norm(), "{own} {whole}");
    }
    // Bristles hold them on the slope.
    let along: f64 = points.iter().map(|point| point.force.x).sum();
    assert!(along < -0.1, "{along}");
}
