//! Bodies made of shapes that stand and roll.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use parry3d_f64::math::Vector;
use parry3d_f64::shape::{
    Ball, Cone, Cuboid, Cylinder, HalfSpace, RoundCuboid, RoundCylinder, Shape as ParryShape,
};
use prehend_sim::{
    Body, BodyId, BodyState, BristleFriction, ContactBodies, Coulomb, GapSmoothing, KelvinVoigt,
    Law, Model, Shape, State,
};

/// A body of `shape` with its body frame at `height` above `ground`, gravity along −y.
pub(crate) fn on(ground: &Shape, shape: &Shape, height: f64) -> (Model, State) {
    let mut model = Model::new(Vector3::y() * -9.81);
    let floor = model.add(Body::fixed_from_shape("ground", ground));
    let body = Body::from_shape("body", shape, 1e3).unwrap();
    let start = body.rigid().unwrap().at_rest(&Isometry3::translation(0.0, height, 0.0));
    let samples = model.add(body);
    let friction = Coulomb { friction: 0.5, slip_scale: 1e-3 };
    let held = BristleFriction { friction, deflection: 1e-5 };
    let law = Law::new(KelvinVoigt { stiffness: 1e8, damping: 1e5 }, held).unwrap();
    let smoothing = GapSmoothing::Softplus { width: 1e-6 };
    model.add_contact(ContactBodies { samples, field: floor }, Arc::new(law), smoothing).unwrap();
    let identity = BodyState::at_rest(Isometry3::identity());
    (model, State::new([identity, start]))
}

fn ground() -> Shape {
    Shape::from_parry(&HalfSpace::new(Vector::Y)).unwrap()
}

#[test]
fn boxes_cylinders_and_cones_stand_and_do_not_creep() {
    let round = |inner_shape| RoundCuboid { inner_shape, border_radius: 2e-3 };
    let shapes: [(&dyn ParryShape, f64); 5] = [
        (&Cuboid::new(Vector::new(0.02, 0.03, 0.04)), 0.03),
        (&Cylinder::new(0.03, 0.02), 0.03),
        (&Cone::new(0.03, 0.02), 0.03),
        (&round(Cuboid::new(Vector::new(0.02, 0.03, 0.04))), 0.032),
        (&RoundCylinder { inner_shape: Cylinder::new(0.03, 0.02), border_radius: 2e-3 }, 0.032),
    ];
    for (parry, height) in shapes {
        let (model, start) = on(&ground(), &Shape::from_parry(parry).unwrap(), height);
        let settled = model.simulate(&start, 0.15).unwrap();
        let end = model.simulate(&settled, 0.15).unwrap();
        let moved = end[1].pose.translation.vector - settled[1].pose.translation.vector;
        let turned = end[1].pose.rotation.angle_to(&start[1].pose.rotation);
        println!("{:?}: moved {:.1e} m, turned {turned:.1e}", parry.shape_type(), moved.norm());
        assert!(moved.norm() < 1e-8 && turned < 1e-8, "{:?} {moved}", parry.shape_type());
        let sunk = start[1].pose.translation.y - end[1].pose.translation.y;
        assert!(sunk > 0.0 && sunk < 2e-5, "{sunk}");
    }
}

#[test]
fn whole_faces_press() {
    // The force at a depth is that of the whole face, the torque none.
    let shapes: [(&dyn ParryShape, f64, f64); 3] = [
        (&Cuboid::new(Vector::new(0.02, 0.005, 0.04)), 0.005, 0.04 * 0.08),
        (&Cylinder::new(0.03, 0.02), 0.03, std::f64::consts::PI * 4e-4),
        (&Cone::new(0.03, 0.02), 0.03, std::f64::consts::PI * 4e-4),
    ];
    for (parry, height, area) in shapes {
        let depth = 1e-4;
        let (model, start) = on(&ground(), &Shape::from_parry(parry).unwrap(), height - depth);
        let wrench = model.wrenches(&start, 0)[BodyId::index(world_body())];
        assert!(
            (wrench.y / (1e8 * depth * area) - 1.0).abs() < 1e-9,
            "{:?} {}",
            parry.shape_type(),
            wrench.y / (1e8 * depth * area)
        );
        assert!(wrench.fixed_rows::<3>(3).norm() < 1e-12 * wrench.y);
    }
}

/// The second body of a model.
fn world_body() -> BodyId {
    let mut model = Model::new(Vector3::zeros());
    model.add(Body::fixed("ground"));
    model.add(Body::fixed("body"))
}

#[test]
fn a_ball_rolls() {
    let (mut model, mut start) = on(&ground(), &Shape::from_parry(&Ball::new(0.03)).unwrap(), 0.03);
    model.gravity = Vector3::new(1.0, -9.81, 0.0);
    start[1].pose.translation.y -= 1e-5;
    let end = model.simulate(&start, 0.2).unwrap();
    // 5/7 of the acceleration.
    let expected = 5.0 / 7.0 * 0.2;
    assert!((end[1].linear.x / expected - 1.0).abs() < 1e-2, "{}", end[1].linear.x);
}
