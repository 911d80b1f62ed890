//! An arm in URDF: where its links are, what holds it against gravity, its limits, losses and a joint that mimics another.

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::robot::KinematicTree;
use prehend_sim::articulated::Joint;
use prehend_sim::robot::UrdfOptions;
use prehend_sim::{BodyId, Model, State};

/// The links are not in the order of the tree.
const ARM: &str = r#"<robot name="arm">
    <link name="finger"><inertial><origin xyz="0.03 0 0"/><mass value="0.2"/>
        <inertia ixx="1e-4" ixy="0" ixz="0" iyy="2e-4" iyz="0" izz="2e-4"/></inertial></link>
    <link name="base"><inertial><mass value="1"/>
        <inertia ixx="1e-2" ixy="0" ixz="0" iyy="1e-2" iyz="0" izz="1e-2"/></inertial></link>
    <link name="mark"/>
    <link name="upper"><inertial><origin xyz="0.1 0 0"/><mass value="0.5"/>
        <inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial></link>
    <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3"/>
        <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/><dynamics damping="0.05"/></joint>
    <joint name="slide" type="prismatic"><parent link="upper"/><child link="finger"/><origin xyz="0.2 0 0"/>
        <axis xyz="1 0 0"/><limit lower="-0.2" upper="0.2" effort="9" velocity="9"/>
        <mimic joint="shoulder" multiplier="0.1" offset="0.02"/></joint>
    <joint name="marked" type="fixed"><parent link="upper"/><child link="mark"/><origin xyz="0.05 0 0.01"/></joint>
    </robot>"#;

fn arm(gravity: f64) -> (KinematicTree, Model, Vec<BodyId>) {
    let tree = KinematicTree::from_urdf_str(ARM, None).unwrap();
    let mut model = Model::new(Vector3::new(0.0, 0.0, -gravity));
    let t_world_base = Isometry3::translation(1.0, 2.0, 3.0);
    let options = UrdfOptions { t_world_base, ..UrdfOptions::default() };
    let bodies = model.add_articulated_robot(&tree, None, &options).unwrap();
    (tree, model, bodies)
}

fn body(tree: &KinematicTree, bodies: &[BodyId], name: &str) -> BodyId {
    bodies[tree.links().iter().position(|link| link.name == name).unwrap()]
}

/// Position and velocity of shoulder and slide after `time` seconds, the shoulder beginning at `from`.
fn moved(gravity: f64, from: [f64; 2], time: f64) -> [[f64; 2]; 2] {
    let (tree, model, bodies) = arm(gravity);
    let [upper, finger] = ["upper", "finger"].map(|name| body(&tree, &bodies, name));
    let mut states: State = model.neutral_state();
    model.set_joint(&mut states, upper, &[from[0]], &[from[1]]).unwrap();
    let follow = [0.1 * from[0] + 0.02, 0.1 * from[1]];
    model.set_joint(&mut states, finger, &[follow[0]], &[follow[1]]).unwrap();
    let end = model.simulate(&states, time).unwrap();
    [upper, finger].map(|link| {
        let joint = model.joint(&end, link).unwrap();
        [joint.position[0], joint.velocity[0]]
    })
}

#[test]
fn what_mimics_is_set_with_its_leader() {
    let (tree, model, bodies) = arm(9.81);
    let [upper, finger] = ["upper", "finger"].map(|name| body(&tree, &bodies, name));
    let mut states: State = model.neutral_state();
    assert_eq!(model.joint(&states, finger).unwrap().position, [0.02]);
    model.set_joint(&mut states, upper, &[0.4], &[0.7]).unwrap();
    let slide = model.joint(&states, finger).unwrap();
    assert!((slide.position[0] - 0.06).abs() < 1e-15 && (slide.velocity[0] - 0.07).abs() < 1e-15);
    // It may be pulled away from there.
    model.set_joint(&mut states, finger, &[0.1], &[0.0]).unwrap();
    assert_eq!(model.joint(&states, finger).unwrap().position, [0.1]);
    assert_eq!(model.joint(&states, upper).unwrap().position, [0.4]);
}

#[test]
fn links_are_where_kinematics_has_them() {
    let (tree, model, bodies) = arm(9.81);
    assert_eq!(bodies.len(), 4);
    let mut states: State = model.neutral_state();
    model.set_joint(&mut states, body(&tree, &bodies, "upper"), &[0.4], &[0.0]).unwrap();
    model.set_joint(&mut states, body(&tree, &bodies, "finger"), &[0.06], &[0.0]).unwrap();
    assert_eq!(tree.joint_names(), ["shoulder"]);
    let poses = tree.forward_kinematics(&[0.4]);
    for (body, pose) in bodies.iter().zip(poses) {
        let expected = Isometry3::translation(1.0, 2.0, 3.0) * pose;
        let found = states[*body].pose;
        assert!((found.to_homogeneous() - expected.to_homogeneous()).amax() < 1e-12, "{found}");
    }
    // What holds the shoulder against gravity.
    let own = &model.articulations[0];
    assert_eq!(own.tree.nv(), 2);
    let [q, v] = super::coordinates(&model, &states);
    let at = own.tree.kinematics(&q, &v).under(model.gravity);
    let efforts = at.inverse_dynamics(&[0.0; 2]);
    let [upper, finger] = ["upper", "finger"].map(|name| {
        let link = own.bodies().iter().position(|b| *b == body(&tree, &bodies, name)).unwrap();
        efforts[own.tree.range(link)[1].start]
    });
    let weights = 0.5 * 0.1 + 0.2 * (0.2 + 0.06 + 0.03);
    assert!((upper + 9.81 * weights * 0.4_f64.cos()).abs() < 1e-12, "{upper}");
    assert!((finger + 9.81 * 0.2 * 0.4_f64.sin()).abs() < 1e-12, "{finger}");
}

#[test]
fn limits_losses_and_mimicry_act() {
    // It falls onto its limit and stays there, the slide with it.
    let [[angle, speed], [place, _]] = moved(9.81, [0.2, 0.0], 3.0);
    assert!((angle - 1.0).abs() < 0.01 && speed.abs() < 1e-3, "{angle} {speed}");
    assert!((place - (0.1 * angle + 0.02)).abs() < 1e-3, "{place} {angle}");
    // Without gravity only losses slow it down: by the damping over the inertia, while the slide hardly moves.
    let [[_, speed], [place, slide]] = moved(0.0, [-0.2, 0.3], 0.1);
    let finger = 2e-4 + 0.2 * (0.2315_f64.powi(2) + 0.1_f64.powi(2));
    let inertia = 1e-3 + 0.5 * 0.1_f64.powi(2) + finger;
    let expected = 0.3 * (-0.05 / inertia * 0.1).exp();
    assert!((speed / expected - 1.0).abs() < 0.05, "{speed} {expected}");
    assert!((slide - 0.1 * speed).abs() < 2e-3 && place.abs() < 0.02, "{place} {slide}");
}

#[test]
fn inertias_that_no_body_has_matter_where_joints_feel_them() {
    let impossible = r#"<inertia ixx="-1e-3" ixy="0" ixz="0" iyy="2e-3" iyz="0" izz="2e-3"/>"#;
    let given = r#"<inertia ixx="1e-4" ixy="0" ixz="0" iyy="2e-4" iyz="0" izz="2e-4"/>"#;
    let added = |axis: &str, joint: Joint| {
        let xml = ARM.replace(given, impossible).replace(r#"<axis xyz="0 1 0"/>"#, axis);
        let tree = KinematicTree::from_urdf_str(&xml, None).unwrap();
        assert_eq!(tree.warnings(), ["link 'finger': no body has its inertia"]);
        let options = UrdfOptions { base: joint, ..UrdfOptions::default() };
        Model::new(Vector3::zeros()).add_articulated_robot(&tree, None, &options).map(|_| ())
    };
    assert!(added(r#"<axis xyz="0 1 0"/>"#, Joint::Fixed).is_ok());
    // The base's makes good for it.
    assert!(added(r#"<axis xyz="0 1 0"/>"#, Joint::Floating).is_ok());
    let error = added(r#"<axis xyz="1 0 0"/>"#, Joint::Fixed).unwrap_err().to_string();
    assert!(
        error.contains("link finger: a principal moment of its inertia is negative"),
        "{error}"
    );
}
