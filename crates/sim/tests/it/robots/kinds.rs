//! A small model of each kind that is read. Masses, poses and accelerations are MuJoCo 4.0's, those of URDF Pinocchio 4.1's, written by `benches/peers/files/kinds.py`.

use nalgebra::Vector3;
use prehend_geometry::mjcf::Model;
use prehend_geometry::robot::KinematicTree;
use prehend_sim::robot::{MjcfError, MjcfOptions, MjcfRobot, UrdfOptions};
use prehend_sim::{RungeKutta4, State, TimeSteps, World};
use serde_json::Value;

use super::golden::numbers;

/// The model of golden values, without limits.
fn read(name: &str, golden: &Value) -> Model {
    let folder =
        std::env::temp_dir().join(format!("prehend_{}_{}", std::process::id(), name.len()));
    std::fs::create_dir_all(&folder).unwrap();
    for (file, text) in golden["files"].as_object().unwrap() {
        let file = if file.is_empty() { "model.xml" } else { file };
        std::fs::write(folder.join(file), text.as_str().unwrap()).unwrap();
    }
    let model = Model::from_file(folder.join("model.xml"));
    std::fs::remove_dir_all(&folder).unwrap();
    let mut model = model.unwrap_or_else(|error| panic!("{name}: {error}"));
    model.bodies.iter_mut().flat_map(|b| &mut b.joints).for_each(|joint| joint.range = None);
    model
}

fn near(what: &str, found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let scale = expected.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
    for (found, expected) in found.iter().zip(expected) {
        let off = (found - expected).abs() / scale;
        assert!(off <= tolerance, "{what}: {found}, not {expected}: off by {off:.1e}");
    }
}

fn start(world: &mut World, robot: &MjcfRobot, state: &Value) -> Vec<State> {
    let [qpos, qvel, ctrl, act] = ["qpos", "qvel", "ctrl", "act"].map(|key| numbers(&state[key]));
    for ((_, id), control) in robot.actuators.iter().zip(&ctrl) {
        world.joint_force_mut(*id).set_param("control", *control).unwrap();
    }
    assert_eq!(robot.actuators.len(), ctrl.len());
    let mut states = world.neutral_states();
    robot.set_positions(world, &mut states, &qpos).unwrap();
    robot.set_velocities(world, &mut states, &qvel).unwrap();
    robot.set_activations(world, &mut states, &act).unwrap();
    states
}

fn places(robot: &MjcfRobot, states: &[State]) -> Vec<f64> {
    let place = |t: Vector3<f64>| [t.x, t.y, t.z];
    robot.bodies.iter().flat_map(|id| place(states[*id].pose.translation.vector)).collect()
}

#[test]
fn each_kind_is_as_mujoco_has_it() {
    let golden: Value = serde_json::from_str(include_str!("../golden/mjcf_kinds.json")).unwrap();
    for (name, golden) in golden.as_object().unwrap() {
        let model = read(name, golden);
        let found = model.bodies.iter().map(|body| {
            let own = body.inertial.map(|i| {
                [vec![i.mass], i.com.coords.as_slice().to_vec(), i.inertia.as_slice().to_vec()]
            });
            own.map_or(vec![0.0; 13], |own| own.concat())
        });
        let found: Vec<Vec<f64>> = found.collect();
        let expected: Vec<Vec<f64>> =
            golden["bodies"].as_array().unwrap().iter().map(numbers).collect();
        assert_eq!(found.len(), expected.len(), "{name}");
        for (k, (found, expected)) in found.iter().zip(&expected).enumerate() {
            near(&format!("{name}: body {k}"), found, expected, 1e-6);
        }
        for (k, state) in golden["states"].as_array().unwrap().iter().enumerate() {
            let mut world = World::new(model.gravity);
            let options = MjcfOptions { shapes: false, ..MjcfOptions::default() };
            let robot = world.add_mjcf(&model, &options).unwrap_or_else(|e| panic!("{name}: {e}"));
            let states = start(&mut world, &robot, state);
            let what = format!("{name}, state {k}");
            near(
                &format!("{what}: places"),
                &places(&robot, &states),
                &numbers(&state["xpos"]),
                1e-9,
            );
            let found = robot.accelerations(&world, &states);
            near(&format!("{what}: accelerations"), &found, &numbers(&state["qacc"]), 1e-6);
            if state["end"].is_object() {
                let time_steps = TimeSteps { dt: model.time_step, steps: 1000 };
                let run = world.rollout_with(&RungeKutta4, &states, time_steps).unwrap();
                let end = run.states.last().unwrap();
                let expected = numbers(&state["end"]["xpos"]);
                near(&format!("{name}: after a second"), &places(&robot, end), &expected, 1e-4);
            }
        }
    }
}

#[test]
fn tendons_follow_each_other() {
    let bodies = "<body name='a'><joint name='a' type='slide' axis='0 0 1' damping='5'/><geom size='.1' mass='1'/><site name='a'/></body>
        <body name='b' pos='1 0 0'><joint name='b' type='slide' axis='0 0 1' damping='1'/><geom size='.1' mass='2'/><site name='b'/></body>
        <site name='u' pos='0 0 1'/><site name='v' pos='1 0 2'/>";
    let cable = |name: &str, from: &str, to: &str| {
        format!("<spatial name='{name}'><site site='{from}'/><site site='{to}'/></spatial>")
    };
    let cables = cable("a", "u", "a") + &cable("b", "v", "b");
    let sums = "<fixed name='a'><joint joint='a' coef='-1'/></fixed><fixed name='b'><joint joint='b' coef='-1'/></fixed>";
    let scene = |tendons: &str, polynomial: &str| {
        let xml = format!(
            "<mujoco><worldbody>{bodies}</worldbody><tendon>{tendons}</tendon>
            <equality><tendon tendon1='a' tendon2='b' polycoef='{polynomial}'/></equality></mujoco>"
        );
        let model = Model::from_str(&xml, None).unwrap();
        let mut world = World::new(model.gravity);
        let options = MjcfOptions { shapes: false, ..MjcfOptions::default() };
        world.add_mjcf(&model, &options).map(|robot| (world, robot))
    };
    for tendons in [&cables, sums] {
        let (world, robot) = scene(tendons, "0.1 0.5").unwrap();
        let end = world.simulate(&world.neutral_states(), 0.2).unwrap();
        let place = |joint: &str| {
            let [position, _] = world.joint_motion(&end, robot.joint(joint).unwrap()).unwrap();
            position
        };
        let (a, b) = (place("a"), place("b"));
        assert!(b < -0.1 && (-a - (0.1 - 0.5 * b)).abs() < 2e-3, "{a} {b}");
    }
    let mixed = cable("a", "u", "a") + "<fixed name='b'><joint joint='b' coef='-1'/></fixed>";
    for refused in [scene(&cables, "0 1 2"), scene(&mixed, "0 1")] {
        assert!(matches!(refused, Err(MjcfError::NoCounterpart { .. })));
    }
}

#[test]
fn urdf_is_as_pinocchio_has_it() {
    let golden: Value = serde_json::from_str(include_str!("../golden/urdf_kinds.json")).unwrap();
    for (name, golden) in golden.as_object().unwrap() {
        let tree = KinematicTree::from_urdf_str(golden["urdf"].as_str().unwrap(), None).unwrap();
        assert_eq!(tree.warnings().is_empty(), name == "strict");
        assert_eq!(serde_json::json!(tree.joint_names()), golden["joints"]);
        let mut world = World::new(Vector3::new(0.0, 0.0, -9.81));
        world.add_articulated_robot(&tree, None, &UrdfOptions::default()).unwrap();
        for state in golden["states"].as_array().unwrap() {
            let q = numbers(&state["q"]);
            let own = &world.articulations[0].tree;
            let at = own.kinematics(&q, &vec![0.0; q.len()]).under(world.gravity);
            near(name, at.mass_matrix().as_slice(), &numbers(&state["mass"]), 1e-12);
            let effort = at.inverse_dynamics(&vec![0.0; q.len()]);
            near(name, effort.as_slice(), &numbers(&state["effort"]), 1e-12);
        }
    }
}
