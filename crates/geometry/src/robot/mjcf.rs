//! From an MJCF model to a [`KinematicTree`].

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::collision::COLUMNS;
use super::kinematics::t_parent_child;
use super::{Drive, Joint, KinematicTree, Link, Motion, Result, RobotError, limits, tree};
use crate::io::read_plain;
use crate::limits::MAX_URDF_BYTES;
use crate::mesh::TriMesh;
use crate::mjcf::{Body, EqualityKind, Geom, JointIndex, JointKind, Model, Shape};
use crate::read_options::ReadOptions;
use crate::shapes;

impl KinematicTree {
    /// Reads a URDF or MJCF file, by its outermost element; mesh files are looked for in its folder, below, and in its package ([`ReadOptions::root`]).
    ///
    /// # Errors
    /// [`RobotError`], naming this file.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self> {
        Self::from_file_with(path, &ReadOptions::default())
    }

    /// [`from_file`](Self::from_file) with options.
    ///
    /// # Errors
    /// [`RobotError`], naming this file.
    pub fn from_file_with(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let path = path.as_ref();
        let read_error = |source| RobotError::Read { path: path.into(), source };
        let text = read_plain(path, MAX_URDF_BYTES).map_err(read_error)?;
        if outermost_element(&String::from_utf8_lossy(&text)) != Some("mujoco") {
            return Self::from_urdf_file_with(path, options);
        }
        let in_file = |source| RobotError::InFile { path: path.into(), source: Box::new(source) };
        let model = Model::from_file_with(path, options).map_err(|e| RobotError::Mjcf(e.into()))?;
        Self::from_mjcf(&model).map_err(in_file)
    }

    /// Kinematics and collision shapes of an MJCF model. The base is its only body in the world, if that is fixed or free, and else the world, with its shapes.
    /// Joints that a linear equality ties to another mimic it, and those that one holds are fixed; other equalities are [`warnings`](Self::warnings). Meshes count
    /// as they are, not as their hulls; planes and terrain have no shape here. Springs and armatures are not kept.
    ///
    /// # Errors
    /// [`RobotError::UnsupportedJoint`] of balls, and of free bodies beside others; [`RobotError::Structure`] of joints that follow each other, and
    /// where a body or joint without a name cannot be told from another; [`RobotError::Limits`].
    pub fn from_mjcf(model: &Model) -> Result<Self> {
        let mut reader = RobotReader { links: Vec::new(), joints: Vec::new(), bodies: Vec::new() };
        let mut hanging = model.bodies.iter().filter(|body| body.parent.is_none());
        let only = hanging.next().filter(|_| hanging.next().is_none());
        let is_base =
            only.is_some_and(|body| body.joints.iter().all(|joint| joint.kind == JointKind::Free));
        if !is_base {
            let parts = parts(&model.world_geoms);
            reader.links.push(Link { name: "world".to_owned(), parts, inertial: None });
        }
        for (number, body) in model.bodies.iter().enumerate() {
            let body = NamedJoint { body, name: named(&body.name, "body", number) };
            if is_base && body.body.parent.is_none() {
                reader.add_link(&body);
                reader.bodies.push(0);
            } else {
                reader.add(&body)?;
            }
        }
        let RobotReader { links, mut joints, .. } = reader;
        tree::unique("link", links.iter().map(|link| &link.name))?;
        tree::unique("joint", joints.iter().map(|(joint, _)| &joint.name))?;
        let mut warnings: Vec<String> = model.warnings.iter().map(ToString::to_string).collect();
        let variables = drive(&mut joints, &ties(model, &mut warnings))?;
        let joints: Vec<Joint> = joints.into_iter().map(|(joint, _)| joint).collect();
        let (order, root) = tree::order(&links, &joints)?;
        let ranges = limits::ranges(&joints, &variables)?;
        let (name, floating) = (model.name.clone(), Vec::new());
        Ok(Self { name, links, joints, order, root, variables, ranges, floating, warnings })
    }
}

/// A body with the name that its link has.
struct NamedJoint<'a> {
    body: &'a Body,
    name: String,
}

/// The tree as far as it is read.
struct RobotReader {
    links: Vec<Link>,
    /// Joints, with their place in the model.
    joints: Vec<(Joint, Option<JointIndex>)>,
    /// The link that each body is.
    bodies: Vec<usize>,
}

impl RobotReader {
    /// Adds a body that hangs on another or on the world, with a link for each joint but the last, and one more where the last joint's frame is not the body's.
    fn add(&mut self, named: &NamedJoint<'_>) -> Result<()> {
        let NamedJoint { body, name } = named;
        let mut parent = body.parent.map_or(0, |parent| self.bodies[parent]);
        // The next joint's frame, where it is at its reference, in the frame of the link that it is mounted on.
        let mut place = body.t_parent_body;
        for (number, joint) in body.joints.iter().enumerate() {
            let own = match (joint.name.as_str(), body.joints.len()) {
                ("", 1) => name.clone(),
                ("", _) => format!("{name}:{number}"),
                (own, _) => own.to_owned(),
            };
            let anchor = Translation3::from(joint.anchor.coords);
            let back = joint.axis.into_inner() * -joint.reference;
            let (motion, t_body_joint, after) = match joint.kind {
                JointKind::Hinge => {
                    let turned = anchor * UnitQuaternion::from_scaled_axis(back);
                    (Motion::Revolute, turned, Isometry3::from(anchor.inverse()))
                }
                JointKind::Slide => {
                    let slid = Isometry3::from(Translation3::from(back));
                    (Motion::Prismatic, slid, Isometry3::identity())
                }
                JointKind::Ball | JointKind::Free => {
                    let kind = if joint.kind == JointKind::Ball { "ball" } else { "free" };
                    return Err(RobotError::UnsupportedJoint { joint: own, kind: kind.to_owned() });
                }
            };
            let is_body = number + 1 == body.joints.len() && after == Isometry3::identity();
            let child = self.links.len();
            if is_body {
                self.add_link(named);
            } else {
                let name = format!("{name}:{own}");
                self.links.push(Link { name, parts: Vec::new(), inertial: None });
            }
            let index = JointIndex { body: self.bodies.len(), joint: number };
            let moved = Joint {
                name: own,
                motion,
                parent,
                child,
                t_parent_joint: place * t_body_joint,
                axis: joint.axis,
                limits: joint.range,
                drive: Drive::None,
                damping: Some(joint.damping),
                friction: Some(joint.friction_loss),
                velocity_limit: None,
                effort_limit: joint.actuator_force_range.map(|(low, high)| high.max(-low)),
            };
            self.joints.push((moved, Some(index)));
            (parent, place) = (child, after);
            if is_body {
                self.bodies.push(child);
                return Ok(());
            }
        }
        let child = self.add_link(named);
        let fixed = Joint {
            name: format!("{name}:fixed"),
            motion: Motion::Fixed,
            parent,
            child,
            t_parent_joint: place,
            axis: Vector3::x_axis(),
            limits: None,
            drive: Drive::None,
            damping: None,
            friction: None,
            velocity_limit: None,
            effort_limit: None,
        };
        self.joints.push((fixed, None));
        self.bodies.push(child);
        Ok(())
    }

    /// Adds the link that a body is.
    fn add_link(&mut self, NamedJoint { body, name }: &NamedJoint<'_>) -> usize {
        let (name, parts) = (name.clone(), parts(&body.geoms));
        self.links.push(Link { name, parts, inertial: body.inertial });
        self.links.len() - 1
    }
}

/// How an equality ties a joint.
#[derive(Clone, Copy)]
enum Tie {
    /// It stays at a position \[rad or m\].
    Held(f64),
    /// It is at `multiplier` times another's position, plus `offset` \[rad or m\].
    Follows(JointIndex, f64, f64),
}

/// Ties of joints by the active equalities of a model; of others `warnings` hear.
fn ties(model: &Model, warnings: &mut Vec<String>) -> BTreeMap<JointIndex, Tie> {
    let mut ties = BTreeMap::new();
    for (number, equality) in model.equalities.iter().enumerate().filter(|(_, e)| e.active) {
        let tie = match equality.kind {
            EqualityKind::Joint { joints: (own, None), polynomial: [constant, ..] } => {
                Some((own, Tie::Held(model.joint(own).reference + constant)))
            }
            EqualityKind::Joint { joints: (own, Some(leader)), polynomial } => {
                let [constant, linear, curved @ ..] = polynomial;
                let [own_reference, reference] = [own, leader].map(|j| model.joint(j).reference);
                let offset = constant + own_reference - linear * reference;
                (curved == [0.0; 3]).then_some((own, Tie::Follows(leader, linear, offset)))
            }
            _ => None,
        };
        match tie.filter(|(own, _)| !ties.contains_key(own)) {
            Some((own, tie)) => drop(ties.insert(own, tie)),
            None => warnings.push(format!(
                "equality '{}' ties nothing here: its joints move freely",
                named(&equality.name, "equality", number)
            )),
        }
    }
    ties
}

/// Gives each joint its place in the joint vector, the joint that it mimics, or the position at which it is held, and returns the names of that vector's entries.
///
/// # Errors
/// [`RobotError::Structure`] of joints that follow each other.
fn drive(
    joints: &mut [(Joint, Option<JointIndex>)],
    ties: &BTreeMap<JointIndex, Tie>,
) -> Result<Vec<String>> {
    let free = || joints.iter().filter(|(_, at)| at.is_some_and(|at| !ties.contains_key(&at)));
    let (variables, names): (Vec<_>, Vec<_>) =
        free().map(|(joint, at)| (*at, joint.name.clone())).unzip();
    for (joint, at) in joints {
        let Some(mut at) = *at else { continue };
        let (mut multiplier, mut offset, mut hops) = (1.0, 0.0, 0);
        let held = loop {
            match ties.get(&at) {
                None => break None,
                Some(Tie::Held(position)) => break Some(multiplier * position + offset),
                Some(&Tie::Follows(leader, linear, constant)) => {
                    (multiplier, offset) = (multiplier * linear, multiplier * constant + offset);
                    (at, hops) = (leader, hops + 1);
                }
            }
            if hops > ties.len() {
                let reason = format!("joint '{}' is part of a cycle", joint.name);
                return Err(RobotError::Structure { reason });
            }
        };
        let leader = variables.iter().position(|variable| *variable == Some(at));
        let (index, multiplier, offset) = match held {
            Some(position) => (0, 0.0, position),
            None => (leader.unwrap_or_default(), multiplier, offset),
        };
        joint.drive = Drive::Variable { index, multiplier, offset };
        if held.is_some() {
            joint.t_parent_joint = t_parent_child(joint, &[0.0]);
            (joint.motion, joint.drive) = (Motion::Fixed, Drive::None);
        }
    }
    Ok(names)
}

/// Meshes of the geoms that collide, in their body's frame \[m\].
fn parts(geoms: &[Geom]) -> Vec<TriMesh> {
    let colliding = geoms.iter().filter(|geom| geom.collides());
    colliding.filter_map(|geom| Some(mesh(&geom.shape)?.transformed(&geom.t_body_geom))).collect()
}

/// Mesh of a shape, round ones as those of URDF; planes and terrain have none.
fn mesh(shape: &Shape) -> Option<TriMesh> {
    let round = |mesh: TriMesh| mesh.welded();
    Some(match shape {
        Shape::Plane { .. } | Shape::HeightField(_) => return None,
        Shape::Sphere { radius } => round(shapes::sphere(*radius, COLUMNS)),
        Shape::Capsule { radius, half_length } => {
            round(shapes::capsule(*radius, *half_length, COLUMNS, COLUMNS / 4))
        }
        Shape::Cylinder { radius, half_length } => {
            round(shapes::cylinder(*radius, 2.0 * half_length, COLUMNS))
        }
        Shape::Ellipsoid { radii } => {
            let mut ball = shapes::sphere(1.0, COLUMNS);
            ball.vertices.iter_mut().for_each(|v| v.coords.component_mul_assign(radii));
            round(ball)
        }
        Shape::Box { half_extents } => shapes::cuboid(2.0 * half_extents).welded(),
        Shape::Mesh(mesh) => TriMesh::clone(mesh),
    })
}

/// `name`, or kind and number where there is none.
fn named(name: &str, kind: &str, number: usize) -> String {
    if name.is_empty() { format!("{kind} {number}") } else { name.to_owned() }
}

/// Name of the outermost element of XML.
pub fn outermost_element(xml: &str) -> Option<&str> {
    let mut rest = xml;
    loop {
        rest = &rest[rest.find('<')? + 1..];
        if let Some(comment) = rest.strip_prefix("!--") {
            rest = &comment[comment.find("-->")?..];
        } else if !rest.starts_with(['?', '!']) {
            return rest.split(|c: char| c.is_whitespace() || c == '>' || c == '/').next();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_outermost_element_is_found_behind_comments() {
        let of = outermost_element;
        assert_eq!(of("<?xml version=\"1.0\"?><!-- <robot> --><mujoco/>"), Some("mujoco"));
        assert_eq!(of("<!DOCTYPE x>\n<robot\n name='r'>"), Some("robot"));
        assert_eq!(of("<!-- never ends"), None);
        assert_eq!(of(""), None);
    }

    /// Anchors, references, several joints of a body, a joint that follows another's follower.
    const FINGERS: &str = r#"<mujoco model="fingers"><worldbody>
        <geom type="plane" size="1 1 1"/>
        <body name="palm" pos="1 2 3"><freejoint/><geom type="box" size=".05 .04 .01"/>
            <body name="finger" pos=".05 0 0" euler="0 0 30">
                <joint name="spread" axis="0 0 1" pos="0 .01 0" range="-40 40" ref="10"/>
                <joint name="reach" type="slide" axis="1 0 0" ref=".01" range="-.02 .02"/>
                <geom type="capsule" size=".01 .03" pos=".03 0 0" euler="0 90 0"/>
                <body name="tip" pos=".06 0 0">
                    <joint name="bend" axis="0 1 0"/>
                    <geom type="sphere" size=".01"/>
                    <geom type="sphere" size=".02" contype="0" conaffinity="0"/>
                    <body name="nail" pos=".01 0 0"><geom type="ellipsoid" size=".002 .004 .001"/></body>
                </body>
            </body>
            <body name="thumb" pos="-.05 0 0">
                <joint name="thumb" axis="0 1 0" ref="5"/><geom type="cylinder" size=".01 .02"/>
            </body></body></worldbody>
        <equality>
            <joint joint1="thumb" joint2="bend" polycoef=".1 -2 0 0 0"/>
            <joint joint1="bend" joint2="spread" polycoef="0 .5 0 0 0"/>
        </equality></mujoco>"#;

    #[test]
    fn links_are_where_the_model_has_them() {
        let model = Model::from_str(FINGERS, None).unwrap();
        let robot = KinematicTree::from_mjcf(&model).unwrap();
        assert_eq!(robot.joint_names(), ["spread", "reach"]);
        let link = |name| robot.link_index(name).unwrap();
        assert_eq!((link("palm"), robot.root()), (0, 0));
        let parts =
            ["palm", "finger", "tip", "nail"].map(|name| robot.links()[link(name)].parts.len());
        assert_eq!(parts, [1; 4]);
        let (spread, slid) = (0.4_f64, -0.005);
        let poses = robot.forward_kinematics(&[spread, slid]);
        // As MuJoCo has it: about the anchor, by the difference from the reference.
        let turn = |axis: Vector3<f64>, by: f64| UnitQuaternion::from_scaled_axis(axis * by);
        let hinge = |anchor: Vector3<f64>, axis, by| {
            Translation3::from(anchor) * turn(axis, by) * Translation3::from(-anchor)
        };
        let (y, z) = (Vector3::y(), Vector3::z());
        let reference = 10_f64.to_radians();
        let finger = Isometry3::translation(0.05, 0.0, 0.0)
            * turn(z, 30_f64.to_radians())
            * hinge(Vector3::new(0.0, 0.01, 0.0), z, spread - reference)
            * Isometry3::translation(slid - 0.01, 0.0, 0.0);
        let bend = 0.5 * (spread - reference);
        let tip = finger * Isometry3::translation(0.06, 0.0, 0.0) * turn(y, bend);
        let thumb = Isometry3::translation(-0.05, 0.0, 0.0) * turn(y, 0.1 - 2.0 * bend);
        for (name, expected) in [("finger", finger), ("tip", tip), ("thumb", thumb)] {
            let error = poses[link(name)].to_homogeneous() - expected.to_homogeneous();
            assert!(error.norm() < 1e-12, "{name}: {error}");
        }
    }

    #[test]
    fn equalities_tie_joints_or_are_named() {
        let read = |equalities: &str| {
            let hinge = |name: &str| {
                format!(
                    "<body name='{name}'><joint name='{name}' ref='10' pos='0 0 .1'/><geom size='.1'/></body>"
                )
            };
            let bodies = ["a", "b", "c"].map(hinge).concat();
            let text = format!(
                "<mujoco><worldbody><body name='base'><geom size='.1'/>{bodies}</body></worldbody>
                 <equality>{equalities}</equality></mujoco>"
            );
            KinematicTree::from_mjcf(&Model::from_str(&text, None).unwrap())
        };
        let held = read("<joint joint1='a' polycoef='.2 0 0 0 0'/><joint joint1='b' joint2='a'/>")
            .unwrap();
        assert_eq!((held.joint_names(), held.warnings()), (&["c".to_owned()][..], &[][..]));
        let pose = held.forward_kinematics(&[0.0])[held.link_index("a").unwrap()];
        let angle: f64 = pose.rotation.angle();
        assert!((angle - 0.2).abs() < 1e-12, "{pose}");
        let curved = read(
            "<joint name='e' joint1='a' joint2='b' polycoef='0 1 1 0 0'/><joint active='false' joint1='b' joint2='c'/>",
        );
        let curved = curved.unwrap();
        assert_eq!(curved.joint_names().len(), 3);
        assert!(curved.warnings()[0].contains("equality 'e'"), "{:?}", curved.warnings());
        for circle in [
            "<joint joint1='a' joint2='b'/><joint joint1='b' joint2='a'/>",
            "<joint joint1='a' joint2='b'/><joint joint1='b' joint2='c'/><joint joint1='c' joint2='b'/>",
        ] {
            assert!(matches!(read(circle), Err(RobotError::Structure { .. })));
        }
    }

    #[test]
    fn joints_that_are_no_hinge_or_slide_are_named() {
        let refused = |bodies: &str| {
            let text = format!("<mujoco><worldbody>{bodies}</worldbody></mujoco>");
            let model = Model::from_str(&text, None).unwrap();
            KinematicTree::from_mjcf(&model).unwrap_err().to_string()
        };
        let ball = r#"<body name="a"><joint name="b" type="ball"/><geom size=".1"/></body>"#;
        assert!(refused(ball).contains("joint 'b' is of the unsupported kind ball"));
        let two = r#"<body name="a"><geom size=".1"/></body><body name="c"><freejoint name="f"/><geom size=".1"/></body>"#;
        assert!(refused(two).contains("joint 'f' is of the unsupported kind free"));
    }
}
