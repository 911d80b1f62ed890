//! A model with joints of every kind, several on a body, anchors and references. Poses and efforts against gravity are MuJoCo's.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use prehend_geometry::mjcf::Model as MjcfModel;
use prehend_sim::articulated::Joint;
use prehend_sim::robot::{MjcfError, MjcfOptions};
use prehend_sim::{BodyId, Model, ShapeOptions, TimeSteps, model::JointAxis};

const MODEL: &str = r#"<mujoco model="authored"><compiler angle="radian"/><worldbody>
    <geom name="ground" type="plane" size="1 1 .1"/>
    <body name="base" pos="0.1 0.2 0.3" euler="0.1 0.2 0.3">
        <geom type="box" size="0.1 0.1 0.05" mass="2"/>
        <body name="elbow" pos="0.2 0 0.1" euler="0 0.4 0">
            <joint name="yaw" type="hinge" axis="0 0 1" pos="0.01 0.02 0" ref="0.2" armature="0.01"/>
            <joint name="slide" type="slide" axis="1 0 0" ref="0.05"/>
            <joint name="pitch" type="hinge" axis="0 1 0" pos="0 0 0.03"/>
            <inertial mass="0.5" pos="0.05 0 0" diaginertia="1e-3 2e-3 2.5e-3"/>
            <geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.02"/>
            <body name="hand" pos="0.15 0 0"><joint name="ball" type="ball" pos="0 0.01 0"/>
                <inertial mass="0.2" pos="0 0 0.02" diaginertia="1e-4 2e-4 2.5e-4"/></body>
        </body>
    </body>
    <body name="free" pos="0 0 1"><freejoint name="flight"/><geom type="sphere" size="0.05" mass="0.3"/></body>
    </worldbody></mujoco>"#;

/// `qpos` of MuJoCo; quaternions are normalized.
const POSITIONS: [f64; 14] =
    [0.5, 0.12, -0.3, 0.8, 0.1, 0.5, 0.3, 0.4, -0.2, 0.7, 0.9, 0.1, 0.2, -0.3];

/// Places and quaternions (w, x, y, z).
const POSES: [(&str, [f64; 3], [f64; 4]); 4] = [
    (
        "base",
        [0.1, 0.2, 0.3],
        [0.9818561728660808, 0.06407134770607116, 0.09115754934299071, 0.15343930202422257],
    ),
    (
        "elbow",
        [0.36584245108274166, 0.2995921294162346, 0.3270191325985656],
        [0.940290217836259, 0.11879887109641568, 0.13741095419702984, 0.28785302523044526],
    ),
    (
        "hand",
        [0.4858313200709744, 0.39019106762408257, 0.2940582025987243],
        [0.588239489931368, 0.08679998267695734, 0.5761072874817098, 0.5608390667589325],
    ),
    (
        "free",
        [0.4, -0.2, 0.7],
        [0.9233805168766387, 0.10259783520851541, 0.20519567041703082, -0.3077935056255462],
    ),
];

/// Efforts that hold it, of yaw, slide, pitch and ball.
const EFFORTS: [f64; 6] = [
    0.25168540602488265,
    -3.142003159893175,
    -0.5054787213099026,
    -0.035664900824404655,
    -0.022775542334184662,
    -0.011387771167092373,
];

#[test]
fn joints_of_every_kind_are_where_mujoco_has_them() {
    let mjcf = MjcfModel::from_str(MODEL, None).unwrap();
    let mut model = Model::new(mjcf.gravity);
    let robot = model.add_mjcf(&mjcf, &MjcfOptions::default()).unwrap();
    let mut states = model.neutral_state();
    robot.set_positions(&model, &mut states, &POSITIONS).unwrap();
    for (name, place, [w, i, j, k]) in POSES {
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
        let expected = Isometry3::from_parts(Translation3::from(place), turn);
        let found = states[robot.body(name).unwrap()].pose;
        let off = (found.to_homogeneous() - expected.to_homogeneous()).amax();
        assert!(off < 1e-12, "{name}: {off}");
    }
    let own = &model.articulations[0];
    let [q, v] = super::coordinates(&model, &states);
    let at = own.tree.kinematics(&q, &v).under(model.gravity);
    let effort = at.inverse_dynamics(&vec![0.0; v.len()]);
    for (found, expected) in effort.iter().zip(EFFORTS) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
    // The ground is there, and shapes touch it.
    let ground: BodyId = model.body_named("ground").unwrap();
    assert!(model.bodies[ground].field.is_some());
    assert!(model.bodies[robot.body("free").unwrap()].surface.is_some());
    // The free ball falls.
    let time_steps = TimeSteps { dt: 0.1, steps: 1 };
    let end = &model.rollout(&states, time_steps).unwrap()[1];
    let fallen = 0.7 - end[robot.body("free").unwrap()].pose.translation.z;
    assert!((fallen - 0.5 * 9.81 * 0.01).abs() < 1e-6, "{fallen}");

    // A model that is placed takes its model with it.
    let options = MjcfOptions {
        t_world_mjcf: Isometry3::translation(5.0, 0.0, 2.0),
        ..MjcfOptions::default()
    };
    let mut moved = Model::new(mjcf.gravity);
    let robot_there = moved.add_mjcf(&mjcf, &options).unwrap();
    let mut there = moved.neutral_state();
    robot_there.set_positions(&moved, &mut there, &POSITIONS).unwrap();
    for (here, other) in robot.bodies.iter().zip(&robot_there.bodies) {
        let by = there[*other].pose.translation.vector - states[*here].pose.translation.vector;
        assert!((by - Vector3::new(5.0, 0.0, 2.0)).norm() < 1e-12);
    }

    let refused = robot.set_positions(&model, &mut states, &POSITIONS[1..]);
    assert_eq!(refused, Err(MjcfError::Count { what: "positions", given: 13, expected: 14 }));
}

#[test]
fn a_body_of_several_joints_is_one_with_one_mass() {
    let mjcf = r#"<mujoco><worldbody>
        <body name="bob"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
            <joint name="turn" type="hinge"/><geom type="sphere" size="0.1" mass="0.3"/></body>
        <body name="tail" pos="1 0 0"><joint name="lead" type="hinge"/><geom type="sphere" size="0.1" mass="1"/></body>
        </worldbody></mujoco>"#;
    let mjcf = MjcfModel::from_str(mjcf, None).unwrap();
    let mut model = Model::new(Vector3::zeros());
    let robot = model.add_mjcf(&mjcf, &MjcfOptions::default()).unwrap();
    let mass = |model: &Model, name: &str| {
        let place = model.parameter_names().iter().position(|own| own == name).unwrap();
        model.parameters()[place]
    };
    assert_eq!([mass(&model, "bob.mass"), mass(&model, "tail.mass")], [0.3, 1.0]);
    assert_eq!(model.body_named("bob"), robot.body("bob"));
    let joints: Vec<&str> = robot.joints.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(joints, ["bob:0", "bob:1", "turn", "lead"]);
    let names: Vec<&str> = model.bodies.iter().map(|body| body.name.as_str()).collect();
    assert_eq!(names, ["bob:0", "bob:1", "bob", "tail"]);
}

#[test]
fn a_model_hangs_on_the_joint_that_is_asked_for_and_has_shapes_if_wanted() {
    let mjcf = MjcfModel::from_str(MODEL, None).unwrap();
    let mut model = Model::new(mjcf.gravity);
    let options = MjcfOptions {
        base: Joint::Prismatic(nalgebra::Vector3::x_axis()),
        shapes: false,
        ..MjcfOptions::default()
    };
    let robot = model.add_mjcf(&mjcf, &options).unwrap();
    assert!(model.body_named("ground").is_none());
    assert!(model.bodies.iter().all(|body| body.surface.is_none() && body.field.is_none()));
    let mut states = model.neutral_state();
    let base = robot.body("base").unwrap();
    let before = states[base].pose;
    model.set_joint(&mut states, base, &[0.25], &[0.0]).unwrap();
    let by = states[base].pose.translation.vector - before.translation.vector;
    // Along the axis of the base's own frame, which the file turns.
    let along = before.rotation * nalgebra::Vector3::x() * 0.25;
    assert!((by - along).norm() < 1e-12, "{by}");
    // Positions of the file do not name that slide.
    robot.set_positions(&model, &mut states, &POSITIONS).unwrap();
    let slide: JointAxis = base.into();
    let [position, _] = model.joint_motion(&states, slide).unwrap();
    assert_eq!(position, 0.25);
    // What flies does not hang on it.
    let free = states[robot.body("free").unwrap()].pose.translation.vector;
    assert!((free - nalgebra::Vector3::new(0.4, -0.2, 0.7)).norm() < 1e-12);
}

#[test]
fn a_model_that_cannot_be_leaves_the_world_as_it_was() {
    let flawed = r#"<mujoco><worldbody><body name="light"><joint name="hinge" type="hinge"/>
        <inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>
        <geom type="box" size="0.1 0.1 0.1"/></body></worldbody></mujoco>"#;
    let mjcf = MjcfModel::from_str(flawed, None).unwrap();
    let mut model = Model::new(mjcf.gravity);
    // Edges rounder than the box is wide.
    let shape_options = ShapeOptions { rounding: Some(1.0), ..ShapeOptions::default() };
    let options = MjcfOptions { shape_options, ..MjcfOptions::default() };
    let error = model.add_mjcf(&mjcf, &options).unwrap_err();
    assert!(matches!(&error, MjcfError::Shape { body, .. } if body == "light"), "{error}");
    assert!(model.bodies.is_empty() && model.articulations.is_empty());
    assert!(model.joint_forces.is_empty());
}
