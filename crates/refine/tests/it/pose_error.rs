//! Errors of poses.

use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use prehend_refine::evaluate::metrics::{oe_deg, oe_symmetric_deg, pe_cm};
use prehend_refine::symmetry::{ContinuousSymmetry, Symmetries};

fn pose(x: f64, axis_angle: [f64; 3]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(axis_angle));
    Isometry3::from_parts(Translation3::new(x, 0.01, 0.5), rotation)
}

#[test]
fn errors_of_known_poses() {
    let (a, b) = (pose(0.0, [0.0; 3]), pose(0.03, [0.0, 0.6, 0.0]));
    assert!((pe_cm(&a, &b) - 3.0).abs() < 1e-12);
    assert!((oe_deg(&a, &b) - 0.6_f64.to_degrees()).abs() < 1e-12);
    assert!((oe_deg(&pose(0.0, [0.0, 0.0, 1e-9]), &a) - 1e-9_f64.to_degrees()).abs() < 1e-20);
}

#[test]
fn equals_the_definition_and_ignores_the_sign_of_a_quaternion() {
    let (a, b) = (pose(0.0, [2.0, -1.0, 1.5]), pose(0.0, [-0.4, 0.3, 0.9]));
    let dot = a.rotation.coords.dot(&b.rotation.coords);
    let defined = (2.0 * dot * dot - 1.0).acos().to_degrees();
    assert!((oe_deg(&a, &b) - defined).abs() < 1e-9);
    let mut flipped = b;
    flipped.rotation = UnitQuaternion::new_unchecked(-b.rotation.into_inner());
    assert!((oe_deg(&a, &flipped) - defined).abs() < 1e-9);
}

#[test]
fn symmetry_never_adds_and_forgives_what_it_should() {
    let axis = Unit::new_normalize(Vector3::new(0.2, -0.4, 1.0));
    let spin = UnitQuaternion::from_axis_angle(&axis, 2.1);
    let tilt =
        UnitQuaternion::from_axis_angle(&Unit::new_normalize(axis.cross(&Vector3::x())), 0.3);
    let truth = pose(0.0, [0.5, 1.0, -0.3]);
    let mut estimate = truth;
    estimate.rotation = truth.rotation * tilt * spin;
    let mut symmetries = Symmetries::default();
    let plain = oe_deg(&estimate, &truth);
    assert!((oe_symmetric_deg(&estimate, &truth, &symmetries) - plain).abs() < 1e-12);
    symmetries.continuous.push(ContinuousSymmetry { axis, point: Point3::origin() });
    let tilted = 0.3_f64.to_degrees();
    assert!((oe_symmetric_deg(&estimate, &truth, &symmetries) - tilted).abs() < 1e-9);
    // Discretized, the same comes out to within half a step.
    let transforms = symmetries.transforms();
    let discretized = transforms.iter().map(|s| oe_deg(&estimate, &(truth * s)));
    let best = discretized.fold(f64::INFINITY, f64::min);
    assert!((best - tilted).abs() < 0.5 && best >= tilted - 1e-9);
}

#[test]
fn discrete_and_continuous_symmetries_combine() {
    let flip = Isometry3::rotation(Vector3::x() * std::f64::consts::PI);
    let truth = pose(0.0, [0.5, 1.0, -0.3]);
    let mut symmetries = Symmetries { discrete: vec![flip], continuous: vec![] };
    let turned = truth * flip;
    assert!(oe_deg(&turned, &truth) > 179.9);
    assert!(oe_symmetric_deg(&turned, &truth, &symmetries) < 1e-9);
    let axis = ContinuousSymmetry { axis: Vector3::z_axis(), point: Point3::origin() };
    symmetries.continuous.push(axis);
    let estimate = truth * Isometry3::rotation(Vector3::z() * 1.3) * flip;
    assert!(oe_deg(&estimate, &truth) > 90.0);
    assert!(oe_symmetric_deg(&estimate, &truth, &symmetries) < 1e-9);
}

#[test]
fn transforms_act_as_they_are_given_not_their_inverses() {
    let third = Isometry3::rotation(Vector3::z() * (std::f64::consts::TAU / 3.0));
    let truth = pose(0.0, [0.5, 1.0, -0.3]);
    let mut symmetries = Symmetries { discrete: vec![third], continuous: vec![] };
    assert!(oe_symmetric_deg(&(truth * third), &truth, &symmetries) < 1e-9);
    assert!(oe_symmetric_deg(&(truth * third.inverse()), &truth, &symmetries) > 100.0);
    let axis = ContinuousSymmetry { axis: Vector3::x_axis(), point: Point3::origin() };
    symmetries.continuous.push(axis);
    let spin = Isometry3::rotation(Vector3::x() * 1.3);
    assert!(oe_symmetric_deg(&(truth * spin * third), &truth, &symmetries) < 1e-9);
    assert!(oe_symmetric_deg(&(truth * third * spin), &truth, &symmetries) > 10.0);
}
