//! Articulated bodies against Pinocchio: `benches/peers/sim/articulated_golden.py` has made the values.

use nalgebra::{DVector, Isometry3, Matrix3, Point3, Quaternion, Unit, UnitQuaternion, Vector3};
use prehend_sim::articulated::{Articulation, Joint, Link};
use serde_json::Value;

const GOLDEN: &str = include_str!("../golden/articulated.json");

/// Relative to the largest number of its kind, or a thousandth where all are zero.
const TOLERANCE: f64 = 1e-9;

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(all) => all.iter().map(|x| x.as_f64().unwrap()).collect(),
        one => vec![one.as_f64().unwrap()],
    }
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_column_slice(&numbers(value))
}

fn link(index: usize, told: &Value) -> Link {
    let axis = Unit::new_normalize(vector(&told["axis"]));
    let turn = numbers(&told["turn"]);
    let turn = Quaternion::new(turn[3], turn[0], turn[1], turn[2]);
    Link {
        name: index.to_string(),
        parent: usize::try_from(told["parent"].as_i64().unwrap()).ok(),
        t_parent_joint: Isometry3::from_parts(
            vector(&told["place"]).into(),
            UnitQuaternion::from_quaternion(turn),
        ),
        joint: match told["kind"].as_str().unwrap() {
            "revolute" => Joint::Revolute(axis),
            "prismatic" => Joint::Prismatic(axis),
            "spherical" => Joint::Spherical,
            "floating" => Joint::Floating,
            other => panic!("joint {other}"),
        },
        mass: told["mass"].as_f64().unwrap(),
        com: vector(&told["com"]).into(),
        inertia: Matrix3::from_row_slice(&numbers(&told["inertia"])),
        armature: 0.0,
    }
}

#[test]
fn open_trees_are_as_pinocchio_has_them() {
    let trees: Vec<Value> = serde_json::from_str(GOLDEN).unwrap();
    assert_eq!(trees.len(), 7);
    for golden in &trees {
        let name = golden["name"].as_str().unwrap();
        let links: Vec<Link> = golden["links"]
            .as_array()
            .unwrap()
            .iter()
            .enumerate()
            .map(|(i, l)| link(i, l))
            .collect();
        let last = links.len() - 1;
        let tree = Articulation::new(links, Vector3::new(0.3, -0.2, -9.81)).unwrap();
        let [q, v, a, tau, w] =
            ["q", "v", "a", "tau", "direction"].map(|key| numbers(&golden[key]));
        let w = DVector::from_vec(w);
        let assert_near = |key: &str, found: &[f64]| {
            let expected = numbers(&golden[key]);
            assert_eq!(found.len(), expected.len(), "{name}: {key}");
            let size = expected.iter().fold(1e-3f64, |size, x| size.max(x.abs()));
            for (found, expected) in found.iter().zip(&expected) {
                let error = (found - expected).abs() / size;
                assert!(error < TOLERANCE, "{name}: {key}: {found}, not {expected}");
            }
        };
        let at = tree.kinematics(&q, &v);
        assert_near("place", at.pose(last).translation.vector.as_slice());
        let jacobian = at.jacobian(last, &Point3::origin());
        assert_near("jacobian", (jacobian * DVector::from_column_slice(&v)).as_slice());
        assert_near("kinetic", &[at.energy(&v).kinetic]);
        assert_near("potential", &[at.energy(&v).potential]);
        assert_near("mass_matrix", (at.mass_matrix() * &w).as_slice());
        assert_near("inverse_dynamics", at.inverse_dynamics(&a).as_slice());
        let inverse = at.inverse_dynamics_derivatives(&a);
        assert_near("inverse_by_position", (inverse.by_position * &w).as_slice());
        assert_near("inverse_by_velocity", (inverse.by_velocity * &w).as_slice());
        let accelerations = at.forward_dynamics(&tau);
        assert_near("forward_dynamics", accelerations.as_slice());
        let forward = at.forward_dynamics_derivatives(&accelerations).unwrap();
        assert_near("forward_by_position", (forward.by_position * &w).as_slice());
        assert_near("forward_by_velocity", (forward.by_velocity * &w).as_slice());
        assert_near("forward_by_effort", (forward.by_effort * &w).as_slice());
    }
}
