//! Contacts of all bodies by the default material.

use nalgebra::Vector3;
use prehend_sim::{Body, Material, Model, Shape, State};

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
