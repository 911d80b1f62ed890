//! From URDF text to a [`KinematicTree`].

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::Path;

use nalgebra::{Isometry3, Unit, Vector3};
use roxmltree::Node;

use super::urdf_reader::{UrdfReader, finite, parse};
use super::{
    Drive, Joint, KinematicTree, Link, Motion, Result, RobotError, collision, dynamics, limits,
    tree,
};
use crate::io::folder::Folder;
use crate::io::read_plain;
use crate::limits::MAX_URDF_BYTES;
use crate::read_options::ReadOptions;

impl KinematicTree {
    /// Reads a URDF file; mesh files are looked for in its folder, below, and in its package ([`ReadOptions::root`]).
    ///
    /// # Errors
    /// [`RobotError`], naming this file.
    pub fn from_urdf_file(path: impl AsRef<Path>) -> Result<Self> {
        Self::from_urdf_file_with(path, &ReadOptions::default())
    }

    /// [`from_urdf_file`](Self::from_urdf_file) with options.
    ///
    /// # Errors
    /// [`RobotError`], naming this file.
    pub fn from_urdf_file_with(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let path = path.as_ref();
        let read_error = |source| RobotError::Read { path: path.into(), source };
        let bytes = read_plain(path, MAX_URDF_BYTES).map_err(read_error)?;
        let text = String::from_utf8(bytes)
            .map_err(|e| read_error(io::Error::new(io::ErrorKind::InvalidData, e)))?;
        Self::from_urdf(&text, Some(&options.folder(path)), options)
            .map_err(|source| RobotError::InFile { path: path.into(), source: Box::new(source) })
    }

    /// Reads URDF text. Relative and `package://` mesh files are looked for in `asset_dir` and never
    /// outside of it; visual shapes are not read.
    ///
    /// Mimicking joints follow the joint they name; `continuous` joints are revolute ones without limits, and so are
    /// those whose `limit` tag, against the format, is missing.
    ///
    /// # Errors
    /// [`RobotError`], naming the link, joint or mesh file.
    pub fn from_urdf_str(xml: &str, asset_dir: Option<&Path>) -> Result<Self> {
        Self::from_urdf(xml, asset_dir.map(Folder::own).as_ref(), &ReadOptions::default())
    }

    fn from_urdf(xml: &str, folder: Option<&Folder>, options: &ReadOptions) -> Result<Self> {
        if xml.len() > MAX_URDF_BYTES {
            let (count, limit) = (xml.len(), MAX_URDF_BYTES);
            return Err(RobotError::TooLarge { what: "bytes", count, limit });
        }
        let document = parse(xml.trim_start())?;
        let robot = document.root_element();
        let (mut links, mut tags) = (Vec::new(), Vec::new());
        let mut reader = UrdfReader::default();
        for node in robot.children().filter(Node::is_element) {
            let name = node.attribute("name").unwrap_or_default();
            reader.owner = format!("{} '{name}'", node.tag_name().name());
            match node.tag_name().name() {
                "link" => {
                    let inertial = dynamics::inertial(&mut reader, node)?;
                    let parts = collision::parts(&mut reader, node, folder, options)?;
                    let mut link = Link { name: name.into(), parts, inertial };
                    dynamics::judge(&mut link, options, &mut reader.warnings);
                    links.push(link);
                }
                "joint" => tags.push(JointTag::read(&mut reader, node)?),
                _ => {}
            }
        }
        if links.is_empty() {
            return Err(RobotError::Urdf { message: "the robot has no links".into() });
        }
        let mut warnings = reader.warnings;
        if options.partial {
            let names: BTreeSet<String> = tags.iter().map(|tag| tag.name.clone()).collect();
            for JointTag { name, mimic, .. } in &mut tags {
                if let Some(gone) = mimic.take_if(|mimic| !names.contains(&mimic.leader)) {
                    let what = format!("there is no joint '{}' that it could mimic", gone.leader);
                    warnings.push(format!("joint '{name}': {what}: left out"));
                }
            }
        }
        tree::unique("link", links.iter().map(|l| &l.name))?;
        tree::unique("joint", tags.iter().map(|j| &j.name))?;
        let movers = tags.iter().filter(|j| j.motion != Motion::Fixed && j.mimic.is_none());
        let variables: Vec<String> = movers.map(|j| j.name.clone()).collect();
        let by_name: BTreeMap<&str, &JointTag> =
            tags.iter().map(|tag| (tag.name.as_str(), tag)).collect();
        let link_index = |joint: &str, link: &str| {
            links.iter().position(|l| l.name == link).ok_or_else(|| {
                RobotError::structure(format!(
                    "joint '{joint}' refers to link '{link}', which does not exist"
                ))
            })
        };
        let joint = |tag: &JointTag| {
            let [damping, friction] = tag.damping_and_friction;
            let [velocity_limit, effort_limit] = tag.speed_and_effort;
            Ok(Joint {
                name: tag.name.clone(),
                motion: tag.motion,
                parent: link_index(&tag.name, &tag.links[0])?,
                child: link_index(&tag.name, &tag.links[1])?,
                t_parent_joint: tag.origin,
                axis: tag.axis,
                limits: tag.limits,
                drive: drive(tag, &by_name, &variables)?,
                damping,
                friction,
                velocity_limit,
                effort_limit,
            })
        };
        let joints = tags.iter().map(joint).collect::<Result<Vec<_>>>()?;
        let (order, root) = tree::order(&links, &joints)?;
        let ranges = limits::ranges(&joints, &variables)?;
        let floating = Vec::new();
        Ok(Self {
            name: robot.attribute("name").unwrap_or_default().into(),
            links,
            joints,
            order,
            root,
            variables,
            ranges,
            floating,
            warnings,
        })
    }
}

/// A joint as its element describes it.
struct JointTag {
    name: String,
    motion: Motion,
    /// Names of the parent and the child.
    links: [String; 2],
    origin: Isometry3<f64>,
    axis: Unit<Vector3<f64>>,
    limits: Option<(f64, f64)>,
    speed_and_effort: [Option<f64>; 2],
    damping_and_friction: [Option<f64>; 2],
    mimic: Option<MimicTag>,
}

/// Position of the joint `leader` times a number and plus another.
struct MimicTag {
    leader: String,
    multiplier: f64,
    offset: f64,
}

impl JointTag {
    fn read(reader: &mut UrdfReader, node: Node<'_, '_>) -> Result<Self> {
        let [name, kind] = ["name", "type"].map(|f| node.attribute(f).unwrap_or_default());
        let owner = reader.owner.clone();
        let motion = match kind {
            "fixed" => Motion::Fixed,
            "revolute" | "continuous" => Motion::Revolute,
            "prismatic" => Motion::Prismatic,
            _ => {
                let joint = name.to_owned();
                return Err(RobotError::UnsupportedJoint { joint, kind: kind.into() });
            }
        };
        let origin = reader.origin(node)?;
        let mut link = |tag| match reader.first(node, tag) {
            Some(link) => reader.text(link, "link").map(str::to_owned),
            None => Err(RobotError::Urdf { message: format!("{owner}: it has no {tag}") }),
        };
        let links = [link("parent")?, link("child")?];
        let axis = match reader.first(node, "axis") {
            Some(axis) => reader.three(axis, "xyz")?.unwrap_or([1.0, 0.0, 0.0]),
            None => [1.0, 0.0, 0.0],
        };
        let axis = if motion == Motion::Fixed {
            Vector3::x_axis()
        } else {
            finite(&owner, "axis", &axis)?;
            Unit::try_new(Vector3::from(axis), 1e-9).ok_or_else(|| RobotError::Number {
                owner: owner.clone(),
                field: "axis",
                requirement: "must not be zero",
            })?
        };
        let limit = reader.first(node, "limit");
        let number = |field: &str| -> Result<f64> {
            let given = limit.map(|limit| reader.number(limit, field)).transpose()?;
            Ok(given.flatten().unwrap_or(0.0))
        };
        let [lower, upper, effort, velocity] =
            [number("lower")?, number("upper")?, number("effort")?, number("velocity")?];
        let has_limits = matches!(kind, "revolute" | "prismatic");
        if has_limits && (lower.is_nan() || upper.is_nan()) {
            let (field, requirement) = ("limit", "must be a number");
            return Err(RobotError::Number { owner, field, requirement });
        }
        if lower > upper {
            reader.warn(format!(
                "its limits are from {lower} to {upper}, upside down: none is taken"
            ));
        }
        // Against the format, some descriptions lack the tag: no limit is meant, not a joint that cannot move.
        let absent = [lower, upper, effort, velocity] == [0.0; 4]
            || (lower, upper) == (f64::NEG_INFINITY, f64::INFINITY);
        let damping_and_friction = dynamics::damping_and_friction(reader, node)?;
        let speed_and_effort = [
            dynamics::limit(&owner, "limit velocity", velocity)?,
            dynamics::limit(&owner, "limit effort", effort)?,
        ];
        let mimic = match reader.first(node, "mimic") {
            Some(mimic) => Some(MimicTag {
                leader: reader.text(mimic, "joint")?.to_owned(),
                multiplier: reader.number(mimic, "multiplier")?.unwrap_or(1.0),
                offset: reader.number(mimic, "offset")?.unwrap_or(0.0),
            }),
            None => None,
        };
        Ok(Self {
            name: name.to_owned(),
            motion,
            links,
            origin,
            axis,
            limits: (has_limits && !absent && lower <= upper).then_some((lower, upper)),
            speed_and_effort,
            damping_and_friction,
            mimic,
        })
    }
}

/// Follows mimic tags to the joint that moves on its own, multiplying and adding along the way.
fn drive(
    joint: &JointTag,
    by_name: &BTreeMap<&str, &JointTag>,
    variables: &[String],
) -> Result<Drive> {
    if joint.motion == Motion::Fixed {
        return Ok(Drive::None);
    }
    let (mut multiplier, mut offset) = (1.0, 0.0);
    let mut current = joint;
    for _ in 0..=by_name.len() {
        let Some(mimic) = &current.mimic else {
            return match variables.iter().position(|v| *v == current.name) {
                Some(index) => Ok(Drive::Variable { index, multiplier, offset }),
                // What a fixed joint is copied from is no motion at all, surely by mistake.
                None => Err(RobotError::UnsupportedJoint {
                    joint: joint.name.clone(),
                    kind: "mimic of a fixed joint".into(),
                }),
            };
        };
        let owner = format!("joint '{}'", current.name);
        finite(&owner, "mimic", &[mimic.multiplier, mimic.offset])?;
        offset += multiplier * mimic.offset;
        multiplier *= mimic.multiplier;
        current = by_name.get(mimic.leader.as_str()).ok_or_else(|| RobotError::UnknownJoint {
            joint: mimic.leader.clone(),
            by: format!("the mimic tag of joint '{}'", current.name),
        })?;
    }
    Err(RobotError::structure(format!("mimic joint '{}' is part of a cycle", joint.name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arm(joints: &str) -> Result<KinematicTree> {
        let links: String = "abc".chars().map(|c| format!("<link name=\"{c}\"/>")).collect();
        KinematicTree::from_urdf_str(&format!("<robot name=\"arm\">{links}{joints}</robot>"), None)
    }

    fn joint(name: &str, kind: &str, parent: &str, child: &str, more: &str) -> String {
        format!(
            "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>{more}</joint>"
        )
    }

    #[test]
    fn mimic_chains_resolve_to_the_joint_that_moves() {
        let robot = arm(&(joint(
            "p",
            "continuous",
            "a",
            "b",
            "<mimic joint=\"q\" multiplier=\"-2\" offset=\"0.5\"/>",
        ) + &joint("q", "continuous", "b", "c", "")))
        .unwrap();
        assert_eq!(robot.joint_names(), ["q"]);
        assert_eq!(
            robot.joints()[0].drive,
            Drive::Variable { index: 0, multiplier: -2.0, offset: 0.5 }
        );
        let state = BTreeMap::from([("q".to_owned(), 0.25)]);
        assert_eq!(robot.joint_vector(&state).unwrap(), [0.25]);
    }

    #[test]
    fn every_broken_tree_is_named() {
        let fixed = |n, p, c| joint(n, "fixed", p, c, "");
        let message = |joints: String| arm(&joints).unwrap_err().to_string();
        assert_eq!(message(fixed("p", "a", "b")), "expected one root link, found 2: a, c");
        assert!(message(fixed("p", "b", "c") + &fixed("q", "c", "b")).contains("cycle"));
        assert!(
            message(fixed("p", "a", "b") + &fixed("q", "b", "c") + &fixed("r", "c", "a"))
                .contains("cycle")
        );
        assert!(
            message(fixed("p", "a", "b") + &fixed("q", "c", "b"))
                .contains("both joint 'p' and joint 'q'")
        );
        assert!(
            message(fixed("p", "a", "b") + &fixed("p", "b", "c"))
                .contains("more than one joint is named 'p'")
        );
        assert!(message(fixed("p", "a", "x")).contains("joint 'p' refers to link 'x'"));
        assert!(
            message(joint("p", "floating", "a", "b", "")).contains("unsupported kind floating")
        );
        let turning = |more| joint("p", "continuous", "a", "b", more) + &fixed("q", "b", "c");
        assert!(message(turning("<axis xyz=\"0 0 0\"/>")).contains("joint 'p': axis"));
        assert!(message(turning("<axis xyz=\"0 NaN 0\"/>")).contains("must be finite"));
        assert!(message(turning("<origin xyz=\"0 inf 0\"/>")).contains("origin xyz"));
        assert!(
            message(turning("<mimic joint=\"x\"/>"))
                .contains("joint 'x', named by the mimic tag of joint 'p'")
        );
        assert!(message(turning("<mimic joint=\"q\"/>")).contains("mimic of a fixed joint"));
        assert!(
            message(turning("<mimic joint=\"p\"/>")).contains("mimic joint 'p' is part of a cycle")
        );
        assert!(matches!(
            KinematicTree::from_urdf_str("<robot", None),
            Err(RobotError::Urdf { .. })
        ));
        assert!(matches!(KinematicTree::from_urdf_str("", None), Err(RobotError::Urdf { .. })));
        assert!(matches!(
            KinematicTree::from_urdf_file("/nowhere/x.urdf"),
            Err(RobotError::Read { .. })
        ));
    }

    #[test]
    fn depth_of_tags_takes_no_stack() {
        for (tag, end) in
            [("<link name=\"l\">", "</link>"), ("<x>", "</x>"), ("<!-- > --><gazebo>", "</gazebo>")]
        {
            let open = format!("<robot name=\"r\"><link name=\"a\"/>{}", tag.repeat(200_000));
            let error = KinematicTree::from_urdf_str(&open, None).unwrap_err();
            assert!(matches!(error, RobotError::Urdf { .. }), "{error}");
            // The outermost link counts alone.
            let closed = format!("{open}{}</robot>", end.repeat(200_000));
            let robot =
                KinematicTree::from_urdf_str(&closed.replace("<link name=\"a\"/>", ""), None);
            assert_eq!(robot.is_ok(), end == "</link>");
        }
        // Comments and values that look like tags are none.
        let link = |k: i32| format!("<!-- <a> --><link name=\"l{k}\"></link><x y='>'/>");
        let links: String = (0..300).map(link).collect();
        let error =
            KinematicTree::from_urdf_str(&format!("<robot name=\"r\">{links}</robot>"), None);
        assert!(matches!(error, Err(RobotError::Structure { .. })));
    }

    #[test]
    fn joint_states_are_checked() {
        let robot =
            arm(&(joint("p", "continuous", "a", "b", "") + &joint("q", "fixed", "b", "c", "")))
                .unwrap();
        let vector =
            |name: &str, q: f64| robot.joint_vector(&BTreeMap::from([(name.to_owned(), q)]));
        assert_eq!(vector("p", 1.5).unwrap(), [1.5]);
        assert!(matches!(vector("x", 1.0), Err(RobotError::UnknownJoint { .. })));
        assert!(matches!(vector("q", 1.0), Err(RobotError::MissingJoint { .. })));
        assert!(matches!(vector("p", f64::NAN), Err(RobotError::Number { .. })));
    }
}
