//! Kinematics and dynamics, made by `benches/peers/sim/robot_golden.py`.

use nalgebra::{DMatrix, DVector, Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use prehend_geometry::mjcf::Model as MjcfModel;
use prehend_geometry::robot::KinematicTree;
use prehend_sim::articulated::Articulation;
use prehend_sim::robot::{MjcfOptions, UrdfOptions};
use prehend_sim::{BodyId, Model, State};
use serde_json::Value;

use super::data_folder;

pub(super) fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn assert_near(found: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let size = expected.iter().fold(1e-3_f64, |a, b| a.max(b.abs()));
    for (found, expected) in found.iter().zip(expected) {
        let off = (found - expected).abs() / size;
        assert!(off < tolerance, "{what}: {found}, not {expected}: {off:.1e} of {size}");
    }
}

/// A robot in a model: the link of each joint of the golden values, in their order, and the body of each name.
struct Robot {
    model: Model,
    joints: Vec<BodyId>,
    bodies: Vec<(String, BodyId)>,
}

fn mjcf(golden: &Value) -> Robot {
    let file = data_folder().join(golden["file"].as_str().unwrap());
    let mjcf = MjcfModel::from_file(file).unwrap();
    let mut model = Model::new(mjcf.gravity);
    let options = MjcfOptions { shapes: false, ..MjcfOptions::default() };
    let robot = model.add_mjcf(&mjcf, &options).unwrap();
    let names = golden["joints"].as_array().unwrap();
    let joints = names.iter().map(|name| robot.joint(name.as_str().unwrap()).unwrap().link);
    let bodies = mjcf.bodies.iter().map(|body| body.name.clone()).zip(robot.bodies.clone());
    Robot { joints: joints.collect(), bodies: bodies.collect(), model }
}

fn urdf(golden: &Value) -> Robot {
    let file = data_folder().join(golden["file"].as_str().unwrap());
    let tree = KinematicTree::from_urdf_file(file).unwrap();
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    let bodies = model.add_articulated_robot(&tree, None, &UrdfOptions::default()).unwrap();
    let link = |name: &Value| {
        let joint = tree.joints().iter().find(|joint| joint.name == name.as_str().unwrap());
        bodies[joint.unwrap().child]
    };
    let joints = golden["joints"].as_array().unwrap().iter().map(link).collect();
    let names = tree.links().iter().map(|link| link.name.clone());
    Robot { joints, bodies: names.zip(bodies.clone()).collect(), model }
}

/// Degree of freedom of each joint of the golden values.
fn velocity_places(model: &Model, joints: &[BodyId]) -> Vec<usize> {
    let own = &model.articulations[0];
    let place = |body: &BodyId| own.bodies().iter().position(|link| link == body).unwrap();
    joints.iter().map(|body| own.tree.range(place(body))[1].start).collect()
}

fn compare(name: &str, golden: &Value, Robot { model, joints, bodies }: &Robot) {
    let [q, v, a] = ["q", "v", "a"].map(|key| numbers(&golden[key]));
    let mut states: State = model.neutral_state();
    for ((link, q), v) in joints.iter().zip(&q).zip(&v) {
        model.set_joint(&mut states, *link, &[*q], &[*v]).unwrap();
    }
    let mut compared = 0;
    for (body, id) in bodies {
        let Some(expected) = golden["poses"].get(body).map(numbers) else { continue };
        let [x, y, z, w, i, j, k] = expected[..] else { panic!("{body}") };
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
        let expected = Isometry3::from_parts(Translation3::new(x, y, z), turn).to_homogeneous();
        let found = states[*id].pose.to_homogeneous();
        assert!((found - expected).amax() < 1e-9, "{name}: pose of {body}");
        compared += 1;
    }
    assert!(compared >= joints.len() && compared + 2 >= golden["poses"].as_object().unwrap().len());
    let order = velocity_places(model, joints);
    let n = order.len();
    let tree: &Articulation = &model.articulations[0].tree;
    let ordered = |x: &[f64]| {
        let mut own = vec![0.0; n];
        order.iter().zip(x).for_each(|(place, x)| own[*place] = *x);
        own
    };
    let back = |x: &DVector<f64>| order.iter().map(|place| x[*place]).collect::<Vec<f64>>();
    let rows = |m: &DMatrix<f64>| {
        let rows = order.iter().flat_map(|row| order.iter().map(move |column| m[(*row, *column)]));
        rows.collect::<Vec<f64>>()
    };
    let at = tree.kinematics(&ordered(&q), &ordered(&v)).under(model.gravity);
    let a = ordered(&a);
    let effort = at.inverse_dynamics(&a);
    let check = |found: &[f64], key: &str| {
        // MuJoCo infers the inertias of Wonik's hands from meshes in single precision.
        let tolerance =
            if name.starts_with("allegro_") && !name.ends_with("xela") { 1e-8 } else { 1e-9 };
        assert_near(found, &numbers(&golden[key]), tolerance, &format!("{name}: {key}"));
    };
    check(&back(&effort), "effort");
    check(&rows(&at.mass_matrix()), "mass");
    let acceleration = at.forward_dynamics(effort.as_slice());
    check(&back(&acceleration), "acceleration");
    let inverse = at.inverse_dynamics_derivatives(&a);
    check(&rows(&inverse.by_position), "effort_by_position");
    check(&rows(&inverse.by_velocity), "effort_by_velocity");
    let forward = at.forward_dynamics_derivatives(&acceleration).unwrap();
    check(&rows(&forward.by_position), "acceleration_by_position");
    check(&rows(&forward.by_velocity), "acceleration_by_velocity");
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn data_robots_are_as_mujoco_and_pinocchio_have_them() {
    let golden: Value = serde_json::from_str(include_str!("../golden/robots.json")).unwrap();
    for (name, golden) in golden.as_object().unwrap() {
        let robot = if golden["file"].as_str().unwrap().ends_with(".urdf") {
            urdf(golden)
        } else {
            mjcf(golden)
        };
        compare(name, golden, &robot);
    }
}
