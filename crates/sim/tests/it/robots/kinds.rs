//! A small model of each kind that is read. Masses, poses and accelerations are MuJoCo 4.0's, those of URDF Pinocchio 4.1's, written by `benches/peers/files/kinds.py`.

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_geometry::mjcf::Model as MjcfModel;
use prehend_geometry::robot::KinematicTree;
use prehend_sim::robot::{MjcfError, MjcfOptions, MjcfRobot, UrdfOptions};
use prehend_sim::{Model, RolloutFunction, RolloutInputs, RungeKutta4, State, TimeSteps};
use serde_json::Value;

use super::golden::numbers;

/// The model of golden values, without limits.
fn read(name: &str, golden: &Value) -> MjcfModel {
    let folder =
        std::env::temp_dir().join(format!("prehend_{}_{}", std::process::id(), name.len()));
    std::fs::create_dir_all(&folder).unwrap();
    for (file, text) in golden["files"].as_object().unwrap() {
        let file = if file.is_empty() { "model.xml" } else { file };
        std::fs::write(folder.join(file), text.as_str().unwrap()).unwrap();
    }
    let mjcf = MjcfModel::from_file(folder.join("model.xml"));
    std::fs::remove_dir_all(&folder).unwrap();
    let mut mjcf = mjcf.unwrap_or_else(|error| panic!("{name}: {error}"));
    mjcf.bodies.iter_mut().flat_map(|b| &mut b.joints).for_each(|joint| joint.range = None);
    mjcf
}

fn near(what: &str, found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let scale = expected.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
    for (found, expected) in found.iter().zip(expected) {
        let off = (found - expected).abs() / scale;
        assert!(off <= tolerance, "{what}: {found}, not {expected}: off by {off:.1e}");
    }
}

fn start(model: &mut Model, robot: &MjcfRobot, state: &Value) -> State {
    let [qpos, qvel, ctrl, act] = ["qpos", "qvel", "ctrl", "act"].map(|key| numbers(&state[key]));
    for ((_, id), control) in robot.actuators.iter().zip(&ctrl) {
        model.joint_force_mut(*id).set_param("control", *control).unwrap();
    }
    assert_eq!(robot.actuators.len(), ctrl.len());
    let mut states = model.neutral_state();
    robot.set_positions(model, &mut states, &qpos).unwrap();
    robot.set_velocities(model, &mut states, &qvel).unwrap();
    robot.set_activations(model, &mut states, &act).unwrap();
    states
}

fn places(robot: &MjcfRobot, states: &State) -> Vec<f64> {
    let place = |t: Vector3<f64>| [t.x, t.y, t.z];
    robot.bodies.iter().flat_map(|id| place(states[*id].pose.translation.vector)).collect()
}

#[test]
fn each_kind_is_as_mujoco_has_it() {
    let golden: Value = serde_json::from_str(include_str!("../golden/mjcf_kinds.json")).unwrap();
    for (name, golden) in golden.as_object().unwrap() {
        let mjcf = read(name, golden);
        let found = mjcf.bodies.iter().map(|body| {
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
            let mut model = Model::new(mjcf.gravity);
            let options = MjcfOptions { shapes: false, ..MjcfOptions::default() };
            let robot = model.add_mjcf(&mjcf, &options).unwrap_or_else(|e| panic!("{name}: {e}"));
            let states = start(&mut model, &robot, state);
            let what = format!("{name}, state {k}");
            near(
                &format!("{what}: places"),
                &places(&robot, &states),
                &numbers(&state["xpos"]),
                1e-9,
            );
            for (sensor, expected) in state["sensors"].as_object().unwrap() {
                let mut found = robot.sensor(&model, &states, sensor).unwrap();
                let expected = numbers(expected);
                // Two quaternions are one rotation.
                if sensor.contains("quat") && found[0] * expected[0] < 0.0 {
                    found.iter_mut().for_each(|x| *x = -*x);
                }
                near(&format!("{what}: sensor {sensor}"), &found, &expected, 1e-6);
            }
            let found = robot.accelerations(&model, &states);
            near(&format!("{what}: accelerations"), &found, &numbers(&state["qacc"]), 1e-6);
            if state["end"].is_object() {
                let time_steps = TimeSteps { dt: mjcf.time_step, steps: 1000 };
                let run = model.rollout_with(&RungeKutta4, &states, time_steps).unwrap();
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
        let mjcf = MjcfModel::from_str(&xml, None).unwrap();
        let mut model = Model::new(mjcf.gravity);
        let options = MjcfOptions { shapes: false, ..MjcfOptions::default() };
        model.add_mjcf(&mjcf, &options).map(|robot| (model, robot))
    };
    for tendons in [&cables, sums] {
        let (model, robot) = scene(tendons, "0.1 0.5").unwrap();
        let [a, b] = ends(&model, &robot);
        assert!(b < -0.1 && (-a - (0.1 - 0.5 * b)).abs() < 2e-3, "{a} {b}");
    }
    // By higher powers, and a cable by a sum of joints.
    let mixed = cable("a", "u", "a") + "<fixed name='b'><joint joint='b' coef='-1'/></fixed>";
    for tendons in [&cables, sums, &mixed] {
        let (model, robot) = scene(tendons, "0.1 0.5 2 -1").unwrap();
        let [a, b] = ends(&model, &robot);
        assert!(
            b < -0.1 && (-a - (0.1 - 0.5 * b + 2.0 * b * b + b * b * b)).abs() < 4e-3,
            "{a} {b}"
        );
    }
}

#[test]
fn joints_follow_polynomials_of_others() {
    // From their references, as MuJoCo has it.
    let xml = "<mujoco><compiler angle='radian'/><worldbody><body name='a'><joint name='a' axis='0 1 0' ref='.2' damping='.1'/><geom size='.1' pos='.2 0 0'/></body>
        <body name='b'><joint name='b' axis='0 1 0' ref='-.1'/><geom size='.1' pos='.4 0 0'/></body></worldbody>
        <equality><joint joint1='a' joint2='b' polycoef='.05 .5 -.3 .2 .1'/></equality></mujoco>";
    let mjcf = MjcfModel::from_str(xml, None).unwrap();
    let mut model = Model::new(mjcf.gravity);
    let options = MjcfOptions { shapes: false, ..MjcfOptions::default() };
    let robot = model.add_mjcf(&mjcf, &options).unwrap();
    let [a, b] = ends(&model, &robot);
    let x = b + 0.1;
    let follows = 0.05 + x * (0.5 + x * (-0.3 + x * (0.2 + x * 0.1)));
    assert!(x > 0.3 && (a - 0.2 - follows).abs() < 4e-3, "{a} {b}");
}

/// Positions of the joints a and b after a while.
fn ends(model: &Model, robot: &MjcfRobot) -> [f64; 2] {
    let end = model.simulate(&model.neutral_state(), 0.2).unwrap();
    ["a", "b"].map(|joint| model.joint_motion(&end, robot.joint(joint).unwrap()).unwrap()[0])
}

#[test]
fn terrain_is_where_mujoco_has_it() {
    let xml = "<mujoco><asset><hfield name='h' nrow='3' ncol='4' size='.6 .4 .3 .1' elevation='0 1 2 3 2 3 4 5 4 5 6 7'/></asset>
        <worldbody><geom name='ground' type='hfield' hfield='h' pos='.1 -.2 .05' euler='5 -10 30'/></worldbody></mujoco>";
    let mut model = Model::new(Vector3::zeros());
    let mjcf = MjcfModel::from_str(xml, None).unwrap();
    let robot = model.add_mjcf(&mjcf, &MjcfOptions::default()).unwrap();
    assert_eq!(robot.warnings, ["geom 'ground': its field's border"]);
    let ground = model.bodies.iter().find(|body| body.name == "ground").unwrap();
    let field = ground.field.as_ref().unwrap();
    // Where rays from above meet it.
    for place in [
        [0.1, -0.2, 0.2065795233110186],
        [0.3, 0.0, 0.27377191831993386],
        [-0.2, -0.3, 0.09562425931210461],
        [0.2, -0.45, 0.257967393837234],
        [-0.1, 0.05, 0.11651211877755263],
    ] {
        let at = |up: f64| field.sample(&(Point3::from(place) + Vector3::z() * up), 1.0).unwrap();
        // Its heights are in single precision.
        assert!(at(0.0).distance.abs() < 1e-7, "{}", at(0.0).distance);
        assert!(at(0.05).distance > 0.03 && at(-0.05).distance < -0.03);
    }
    let moved = xml.replace(
        "<geom name",
        "<body><freejoint/><inertial mass='1' pos='0 0 0' diaginertia='1 1 1'/><geom name",
    );
    let mjcf =
        MjcfModel::from_str(&moved.replace("</worldbody>", "</body></worldbody>"), None).unwrap();
    let refused = Model::new(Vector3::zeros()).add_mjcf(&mjcf, &MjcfOptions::default());
    assert!(matches!(refused, Err(MjcfError::NoCounterpart { .. })));
}

#[test]
fn mocap_bodies_lead() {
    let xml = "<mujoco><worldbody><body name='hand' mocap='true' pos='0 0 1'><geom size='.1' contype='0' conaffinity='0'/></body>
        <body name='thing' pos='0 0 1'><freejoint/><geom type='box' size='.1 .1 .1'/></body></worldbody>
        <equality><weld body1='hand' body2='thing'/></equality></mujoco>";
    let mjcf = MjcfModel::from_str(xml, None).unwrap();
    let mut model = Model::new(Vector3::zeros());
    let robot = model.add_mjcf(&mjcf, &MjcfOptions::default()).unwrap();
    let mut states = model.neutral_state();
    robot.set_positions(&model, &mut states, &mjcf.reference_positions()).unwrap();
    let pose = Isometry3::new(Vector3::new(0.05, -0.02, 1.1), Vector3::new(0.1, 0.0, 0.2));
    robot.set_mocap(&model, &mut states, "hand", &pose).unwrap();
    let apart = |states: &State, name: &str| {
        let found = states[robot.body(name).unwrap()].pose;
        (found.to_homogeneous() - pose.to_homogeneous()).amax()
    };
    assert!(apart(&states, "hand") < 1e-12);
    let end = model.simulate(&states, 0.3).unwrap();
    assert!(apart(&end, "thing") < 5e-3, "{}", apart(&end, "thing"));
    let wrong = robot.set_mocap(&model, &mut states, "thing", &pose);
    assert_eq!(wrong, Err(MjcfError::NoSuch { kind: "mocap body", name: "thing".to_owned() }));
}

#[test]
fn the_pose_of_a_mocap_body_has_its_derivatives() {
    let xml = "<mujoco><worldbody>
        <body name='hand' mocap='true' pos='.1 0 1' euler='0 20 0'>
            <body pos='0 0 -.1'><joint axis='0 1 0'/><geom size='.02' pos='.1 0 0'/>
                <body pos='.1 .1 0'><joint type='ball'/><geom size='.02' pos='.1 0 .1'/></body></body></body>
        <body name='thing' pos='0 0 1'><freejoint/><geom type='box' size='.1 .1 .1'/></body></worldbody>
        <equality><weld body1='hand' body2='thing'/></equality></mujoco>";
    let mjcf = MjcfModel::from_str(xml, None).unwrap();
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    let robot = model.add_mjcf(&mjcf, &MjcfOptions::default()).unwrap();
    let mut start = model.neutral_state();
    robot.set_positions(&model, &mut start, &mjcf.reference_positions()).unwrap();
    let hand = robot.body("hand").unwrap();
    let places = model.state_places();
    assert_eq!((places.positions.len(), places.velocities.len()), (12, 10));
    assert_eq!((places.fixed.len(), model.fixed_row(hand)), (13, Some(0)));
    assert_eq!(model.coordinate_ranges(hand), None);
    let thing = robot.body("thing").unwrap();
    assert_eq!(model.coordinate_ranges(thing), Some([5..12, 4..10]));

    let time_steps = TimeSteps { dt: 1e-5, steps: 30 };
    let function =
        RolloutFunction::with_integrator(RungeKutta4, &model, time_steps, &[], &[]).unwrap();
    let states: Vec<f64> = start.rows().iter().flat_map(|row| row.coordinates()).collect();
    let inputs = RolloutInputs { states: &states, parameters: &[], controls: &[] };
    let run = function.evaluate(inputs).unwrap();
    // What forces do not move stays, to the bit.
    let last = &run[run.len() - states.len()..];
    assert!(places.fixed.iter().all(|place| last[*place] == states[*place]));
    let adjoints: Vec<f64> = (0..run.len()).map(|k| (k as f64).cos()).collect();
    let by_states = function.vjp(inputs, &run, &adjoints).unwrap().states;
    // Each number by forward mode, those of quaternions along their sphere.
    for place in places.fixed.iter().take(7).chain(&places.positions[..1]) {
        let mut along = vec![0.0; states.len()];
        along[*place] = 1.0;
        let first = places.fixed[3];
        if (first..first + 4).contains(place) {
            let turn = &states[first..first + 4];
            let radial = turn[place - first];
            turn.iter().enumerate().for_each(|(k, x)| along[first + k] -= radial * x);
        }
        let tangents = RolloutInputs { states: &along, parameters: &[], controls: &[] };
        let [_, slopes] = function.jvp(inputs, tangents).unwrap();
        let forward: f64 = slopes.iter().zip(&adjoints).map(|(a, b)| a * b).sum();
        let backward: f64 = along.iter().zip(&by_states).map(|(a, b)| a * b).sum();
        assert!(
            (forward - backward).abs() < 1e-9 * (1.0 + forward.abs()),
            "{place}: {forward} {backward}"
        );
        assert!(forward.abs() > 1e-3, "{place}");
    }
}

#[test]
fn urdf_is_as_pinocchio_has_it() {
    let golden: Value = serde_json::from_str(include_str!("../golden/urdf_kinds.json")).unwrap();
    for (name, golden) in golden.as_object().unwrap() {
        let tree = KinematicTree::from_urdf_str(golden["urdf"].as_str().unwrap(), None).unwrap();
        assert_eq!(tree.warnings().is_empty(), name == "strict");
        assert_eq!(serde_json::json!(tree.joint_names()), golden["joints"]);
        let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
        model.add_articulated_robot(&tree, None, &UrdfOptions::default()).unwrap();
        for state in golden["states"].as_array().unwrap() {
            let q = numbers(&state["q"]);
            let own = &model.articulations[0].tree;
            let at = own.kinematics(&q, &vec![0.0; q.len()]).under(model.gravity);
            near(name, at.mass_matrix().as_slice(), &numbers(&state["mass"]), 1e-12);
            let effort = at.inverse_dynamics(&vec![0.0; q.len()]);
            near(name, effort.as_slice(), &numbers(&state["effort"]), 1e-12);
        }
    }
}
