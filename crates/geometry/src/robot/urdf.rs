//! From URDF text to a [`KinematicTree`].

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use nalgebra::{Unit, Vector3};
use urdf_rs::JointType;

use super::origin::{finite, isometry};
use super::{
    Drive, Joint, KinematicTree, Link, Motion, Result, RobotError, collision, dynamics, lenient,
    limits, tree,
};
use crate::io::folder::Folder;
use crate::io::read_plain;
use crate::limits::{MAX_URDF_BYTES, MAX_URDF_DEPTH};
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
        check_size(xml)?;
        let (xml, mut warnings) = lenient::put_right(xml.trim_start(), options.partial)?;
        let urdf = urdf_rs::read_from_string(&xml)
            .map_err(|error| RobotError::Urdf { message: error.to_string() })?;
        if urdf.links.is_empty() {
            return Err(RobotError::Urdf { message: "the robot has no links".into() });
        }
        tree::unique("link", urdf.links.iter().map(|l| &l.name))?;
        tree::unique("joint", urdf.joints.iter().map(|j| &j.name))?;
        let links = urdf
            .links
            .iter()
            .map(|l| {
                let (parts, inertial) =
                    (collision::parts(l, folder, options, &mut warnings)?, dynamics::inertial(l)?);
                let mut link = Link { name: l.name.clone(), parts, inertial };
                dynamics::judge(&mut link, options, &mut warnings);
                Ok(link)
            })
            .collect::<Result<Vec<_>>>()?;
        let variables: Vec<String> = urdf
            .joints
            .iter()
            .filter(|j| j.joint_type != JointType::Fixed && j.mimic.is_none())
            .map(|j| j.name.clone())
            .collect();
        let by_name: BTreeMap<&str, &urdf_rs::Joint> =
            urdf.joints.iter().map(|j| (j.name.as_str(), j)).collect();
        let link_index = |joint: &urdf_rs::Joint, link: &str| {
            links.iter().position(|l| l.name == link).ok_or_else(|| {
                let joint = &joint.name;
                RobotError::structure(format!(
                    "joint '{joint}' refers to link '{link}', which does not exist"
                ))
            })
        };
        let joints = urdf
            .joints
            .iter()
            .map(|j| {
                let owner = || format!("joint '{}'", j.name);
                let motion = motion(j)?;
                let axis = Vector3::from(j.axis.xyz.0);
                let axis = if motion == Motion::Fixed {
                    Vector3::x_axis()
                } else {
                    finite(&owner, "axis", &j.axis.xyz.0)?;
                    Unit::try_new(axis, 1e-9).ok_or_else(|| RobotError::Number {
                        owner: owner(),
                        field: "axis",
                        requirement: "must not be zero",
                    })?
                };
                let limits = match j.joint_type {
                    JointType::Revolute | JointType::Prismatic => {
                        let l = &j.limit;
                        if l.lower.is_nan() || l.upper.is_nan() {
                            return Err(RobotError::Number {
                                owner: owner(),
                                field: "limit",
                                requirement: "must be a number",
                            });
                        }
                        // Against the format, some descriptions lack the tag: no limit is meant, not a joint that
                        // cannot move.
                        let absent = [l.lower, l.upper, l.effort, l.velocity] == [0.0; 4]
                            || (l.lower, l.upper) == (f64::NEG_INFINITY, f64::INFINITY);
                        (!absent).then_some((l.lower, l.upper))
                    }
                    _ => None,
                };
                let dynamics = dynamics::damping_and_friction(j)?;
                Ok(Joint {
                    name: j.name.clone(),
                    motion,
                    parent: link_index(j, &j.parent.link)?,
                    child: link_index(j, &j.child.link)?,
                    t_parent_joint: isometry(&owner, &j.origin)?,
                    axis,
                    limits,
                    drive: drive(j, &by_name, &variables)?,
                    damping: dynamics.map(|(damping, _)| damping),
                    friction: dynamics.map(|(_, friction)| friction),
                    velocity_limit: dynamics::limit(j, "limit velocity", j.limit.velocity)?,
                    effort_limit: dynamics::limit(j, "limit effort", j.limit.effort)?,
                })
            })
            .collect::<Result<Vec<_>>>()?;
        let (order, root) = tree::order(&links, &joints)?;
        let ranges = limits::ranges(&joints, &variables)?;
        let floating = Vec::new();
        Ok(Self {
            name: urdf.name,
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

/// Refuses text that the XML reader would take too long for, or descend into until the stack ends.
fn check_size(xml: &str) -> Result<()> {
    let too_large = |what, count, limit| Err(RobotError::TooLarge { what, count, limit });
    if xml.len() > MAX_URDF_BYTES {
        return too_large("bytes", xml.len(), MAX_URDF_BYTES);
    }
    let mut depth = 0_usize;
    let mut rest = xml;
    while let Some(start) = rest.find('<') {
        rest = &rest[start..];
        let (end, change) = match rest {
            _ if rest.starts_with("<!--") => (rest.find("-->"), 0),
            _ if rest.starts_with("<![CDATA[") => (rest.find("]]>"), 0),
            _ => (tag_end(rest), if rest.starts_with("</") { -1 } else { 1 }),
        };
        // What never ends is for the parser to complain about.
        let Some(end) = end else { break };
        let is_whole =
            rest.starts_with("<!") || rest.starts_with("<?") || rest[..end].ends_with('/');
        depth = depth.saturating_add_signed(if is_whole { 0 } else { change });
        if depth > MAX_URDF_DEPTH {
            return too_large("levels of tags", depth, MAX_URDF_DEPTH);
        }
        rest = &rest[end..];
    }
    Ok(())
}

/// Where the first tag of `text` ends: a `>` within quotes is part of a value.
fn tag_end(text: &str) -> Option<usize> {
    let mut quote = None;
    text.bytes().position(|byte| {
        match quote {
            Some(open) if byte == open => quote = None,
            None if byte == b'"' || byte == b'\'' => quote = Some(byte),
            _ => {}
        }
        quote.is_none() && byte == b'>'
    })
}

fn motion(joint: &urdf_rs::Joint) -> Result<Motion> {
    match joint.joint_type {
        JointType::Fixed => Ok(Motion::Fixed),
        JointType::Revolute | JointType::Continuous => Ok(Motion::Revolute),
        JointType::Prismatic => Ok(Motion::Prismatic),
        JointType::Floating | JointType::Planar | JointType::Spherical => {
            Err(RobotError::UnsupportedJoint {
                joint: joint.name.clone(),
                kind: format!("{:?}", joint.joint_type).to_lowercase(),
            })
        }
    }
}

/// Follows mimic tags to the joint that moves on its own, multiplying and adding along the way.
fn drive(
    joint: &urdf_rs::Joint,
    by_name: &BTreeMap<&str, &urdf_rs::Joint>,
    variables: &[String],
) -> Result<Drive> {
    if joint.joint_type == JointType::Fixed {
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
        let (m, o) = (mimic.multiplier.unwrap_or(1.0), mimic.offset.unwrap_or(0.0));
        finite(&|| format!("joint '{}'", current.name), "mimic", &[m, o])?;
        offset += multiplier * o;
        multiplier *= m;
        current = by_name.get(mimic.joint.as_str()).ok_or_else(|| RobotError::UnknownJoint {
            joint: mimic.joint.clone(),
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
    fn text_that_nests_without_end_is_refused() {
        for tag in ["<link name=\"l\">", "<x>", "<!-- > --><gazebo>"] {
            let xml = format!("<robot name=\"r\">{}", tag.repeat(200_000));
            let error = KinematicTree::from_urdf_str(&xml, None).unwrap_err();
            assert!(matches!(error, RobotError::TooLarge { limit: MAX_URDF_DEPTH, .. }), "{error}");
        }
        // Many tags side by side are no nest, nor are comments and values that look like tags.
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
