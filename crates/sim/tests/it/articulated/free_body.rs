//! A link that floats is a free body.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend_sim::articulated::{Joint, Link};
use prehend_sim::fields::HalfSpace;
use prehend_sim::{
    Body, BodyState, ContactBodies, Coulomb, GapSmoothing, HuntCrossley, Law, Model, RigidBody,
    State, Surface,
};

/// A brick over a floor, free or as a link.
fn worlds() -> [(Model, State); 2] {
    let inertia = Matrix3::from_diagonal(&Vector3::new(6e-5, 9e-5, 5e-5));
    let com = Point3::new(3e-3, -2e-3, 1e-3);
    let rigid = RigidBody::new(0.2, inertia, com).unwrap();
    let t_world_brick = Isometry3::new(Vector3::new(0.1, 0.2, 0.04), Vector3::new(0.4, -0.2, 0.3));
    let (velocity, spin) = (Vector3::new(0.3, -0.1, -0.5), Vector3::new(2.0, 3.0, -1.0));
    [false, true].map(|linked| {
        let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
        let floor = Body::fixed("floor").with_field(Arc::new(HalfSpace::floor()));
        let floor = model.add(floor);
        let brick = if linked {
            let link = Link::new("brick", Joint::Floating, &rigid);
            model.add_articulation(vec![link]).unwrap()[0]
        } else {
            model.add(Body::dynamic("brick", rigid))
        };
        let surface = Surface::cuboid([0.02, 0.03, 0.01], 0.01).unwrap();
        model.bodies[brick].surface = Some(Arc::new(surface));
        let spring = HuntCrossley { stiffness: 1e8, damping: 0.5, exponent: 1.0 };
        let friction = Coulomb { friction: 0.4, slip_scale: 2e-2 };
        let law = Arc::new(Law::new(spring, friction).unwrap());
        let bodies = ContactBodies { samples: brick, field: floor };
        model.add_contact(bodies, law, GapSmoothing::Softplus { width: 1e-4 }).unwrap();
        let mut states = model.neutral_state();
        if linked {
            let (place, turn) = (t_world_brick.translation.vector, t_world_brick.rotation.coords);
            let q: Vec<f64> = place.iter().chain(turn.iter()).copied().collect();
            let arm = t_world_brick.rotation * com.coords;
            let back = t_world_brick.rotation.inverse();
            let [linear, angular] = [velocity - spin.cross(&arm), spin].map(|v| back * v);
            let v: Vec<f64> = linear.iter().chain(angular.iter()).copied().collect();
            model.set_joint(&mut states, brick, &q, &v).unwrap();
        } else {
            let at = rigid.at_rest(&t_world_brick);
            states[brick] = BodyState { linear: velocity, angular: spin, ..at };
        }
        (model, states)
    })
}

#[test]
fn they_move_alike() {
    let [free, linked] = worlds().map(|(model, states)| model.simulate(&states, 0.25).unwrap()[1]);
    let rigid_com = Vector3::new(3e-3, -2e-3, 1e-3);
    let arm = linked.pose.rotation * rigid_com;
    let center = linked.pose.translation.vector + arm;
    let off = (center - free.pose.translation.vector).norm();
    let turned = linked.pose.rotation.angle_to(&free.pose.rotation);
    assert!(off < 2e-6 && turned < 2e-4, "{off} {turned}");
    let velocity = linked.linear + linked.angular.cross(&arm);
    assert!((velocity - free.linear).norm() < 2e-4);
    assert!(free.pose.translation.z < 0.03 && free.angular.norm() > 0.1);
}
