//! Gravity, friction and collision masks of an MJCF file.

use nalgebra::Vector3;
use prehend_geometry::mjcf;
use prehend_sim::robot::{MjcfError, MjcfOptions};
use prehend_sim::{Model, State};

/// Boxes on a floor that is as steep as 0.3: which slide, which hold, which fall through.
const BOXES: &str = r#"<mujoco><option gravity="2.943 0 -9.81" timestep="0.004"/>
<default><geom type="box" size=".05 .05 .05" density="500"/></default>
<worldbody><geom name="floor" type="plane" size="9 9 1" friction=".05"/>
<body name="holds" pos="0 0 .05"><freejoint/><geom friction=".8"/></body>
<body name="slides" pos="0 1 .05"><freejoint/><geom friction=".1"/></body>
<body name="other bits" pos="0 2 .05"><freejoint/><geom contype="2" conaffinity="2"/></body>
<body name="one bit" pos="0 3 .05"><freejoint/><geom contype="0" conaffinity="1" friction=".8"/></body>
<body name="excluded" pos="0 4 .05"><freejoint/><geom/></body>
<body name="slippery" pos="0 5 .05"><freejoint/><geom friction=".02" priority="1"/></body>
<body name="on top" pos="0 0 .15"><freejoint/><geom friction=".8"/></body>
<body name="within" pos="0 2 .15"><freejoint/><geom friction=".8"/></body>
</worldbody><contact><exclude body1="excluded" body2="world"/></contact></mujoco>"#;

#[test]
fn friction_masks_exclusions_and_gravity_of_a_file_are_applied() {
    let file = mjcf::Model::from_str(BOXES, None).unwrap();
    let (model, scene) = Model::from_mjcf(&file, &MjcfOptions::default()).unwrap();
    assert_eq!((model.gravity, file.time_step), (Vector3::new(2.943, 0.0, -9.81), 0.004));
    let mut start: State = model.neutral_state();
    scene.set_positions(&model, &mut start, &file.reference_positions()).unwrap();
    let end = model.simulate(&start, 0.5).unwrap();
    let at = |name: &str| {
        let index = file.bodies.iter().position(|body| body.name == name).unwrap();
        end[scene.bodies[index]].pose.translation.vector
    };
    let fallen = 0.05 - 0.5 * 9.81 * 0.25;
    for (name, friction) in [("slides", 0.1), ("slippery", 0.02)] {
        let slid = 0.5 * (2.943 - friction * 9.81) * 0.25;
        assert!((at(name).x - slid).abs() < 5e-3, "{name}: {} {slid}", at(name));
        assert!((at(name).z - 0.05).abs() < 1e-3, "{name}: {}", at(name));
    }
    for (name, height) in [("holds", 0.05), ("one bit", 0.05), ("on top", 0.15)] {
        assert!(at(name).x.abs() < 1e-3 && (at(name).z - height).abs() < 2e-3, "{}", at(name));
    }
    for name in ["other bits", "excluded"] {
        assert!((at(name).z - fallen).abs() < 1e-3, "{name}: {}", at(name));
    }
    // Bits of the box below it are others: it comes to rest on the floor.
    assert!(at("within").z < 0.1, "{}", at("within"));
}

#[test]
fn a_scene_is_reset_to_its_start_and_to_keyframes() {
    let file = mjcf::Model::from_str(
        r#"<mujoco><worldbody><body><joint name="q" axis="0 1 0" ref="30"/><geom size=".1" pos="0 0 .2"/></body>
        <body pos="0 0 2"><freejoint/><geom size=".1"/></body></worldbody>
        <actuator><motor name="m" joint="q"/><position name="p" joint="q" kp="3"/></actuator>
        <keyframe><key name="home" time="2" qpos=".4 1 2 3 0 1 0 0" qvel=".5 1 0 0 0 0 2" ctrl="6 7"/></keyframe></mujoco>"#,
        None,
    )
    .unwrap();
    let (mut model, scene) = Model::from_mjcf(&file, &MjcfOptions::default()).unwrap();
    let control = |model: &mut Model, name: &str| {
        let id = scene.actuator(name).unwrap();
        let force = model.joint_force_mut(id);
        force.params()[force.law().param_names().iter().position(|p| *p == "control").unwrap()]
    };
    let mut state: State = model.neutral_state();
    scene.reset_to(&mut model, &mut state, "home").unwrap();
    let axis = scene.joint("q").unwrap();
    assert_eq!((state.time, model.joint_motion(&state, axis).unwrap()), (2.0, [0.4, 0.5]));
    let free = &state[scene.bodies[1]];
    assert!((free.pose.translation.vector - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-15);
    assert!((free.linear - Vector3::x()).norm() < 1e-15);
    // About z of a body that is turned by half about x.
    assert!((free.angular + Vector3::z() * 2.0).norm() < 1e-15, "{}", free.angular);
    assert_eq!([control(&mut model, "m"), control(&mut model, "p")], [6.0, 7.0]);
    scene.set_control(&mut model, "p", 1.0).unwrap();
    assert_eq!([control(&mut model, "m"), control(&mut model, "p")], [6.0, 1.0]);
    scene.reset(&mut model, &mut state).unwrap();
    let expected = (0.0, [30.0_f64.to_radians(), 0.0]);
    assert_eq!((state.time, model.joint_motion(&state, axis).unwrap()), expected);
    assert_eq!([control(&mut model, "m"), control(&mut model, "p")], [0.0; 2]);
    let none = scene.reset_to(&mut model, &mut state, "away");
    assert_eq!(none, Err(MjcfError::NoSuch { kind: "keyframe", name: "away".to_owned() }));
}
