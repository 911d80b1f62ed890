//! Elements of a URDF as its users' tools take them: what is plain though against the format is put right, with a warning.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use roxmltree::{Document, Node};

use super::{Result, RobotError};

/// Error of a description that `xacro` has yet to expand.
const MACROS: &str = "it has xacro macros: run `xacro FILE > robot.urdf` first and read its output";

fn wrong(message: String) -> RobotError {
    RobotError::Urdf { message }
}

/// The document of a robot, its macros expanded.
pub(super) fn parse(xml: &str) -> Result<Document<'_>> {
    let document = Document::parse(xml).map_err(|e| {
        // The prefix may be declared nowhere.
        wrong(if xml.contains("<xacro:") { MACROS.to_owned() } else { e.to_string() })
    })?;
    // The namespace alone says nothing: it stays in what xacro writes.
    let is_macro = |node: &Node<'_, '_>| {
        let mut values = node.attributes().map(|attribute| attribute.value());
        node.tag_name().namespace().is_some_and(|n| n.contains("xacro"))
            || values.any(|value| value.contains("${") || value.contains("$("))
    };
    if document.descendants().any(|node| is_macro(&node)) {
        return Err(wrong(MACROS.to_owned()));
    }
    let outermost = document.root_element().tag_name().name();
    if outermost != "robot" {
        return Err(wrong(format!("the outermost element is '{outermost}', not 'robot'")));
    }
    Ok(document)
}

/// Refuses numbers that are not finite.
pub(super) fn finite(owner: &str, field: &'static str, numbers: &[f64]) -> Result<()> {
    if numbers.iter().all(|x| x.is_finite()) {
        return Ok(());
    }
    Err(RobotError::Number { owner: owner.into(), field, requirement: "must be finite" })
}

/// Reader of the elements of one link or joint after the other.
#[derive(Default)]
pub(super) struct UrdfReader {
    /// The link or joint that is read.
    pub(super) owner: String,
    /// What was put right.
    pub(super) warnings: Vec<String>,
}

impl UrdfReader {
    pub(super) fn warn(&mut self, what: impl std::fmt::Display) {
        self.warnings.push(format!("{}: {what}", self.owner));
    }

    /// The first element in `node` of that tag; others are warned about.
    pub(super) fn first<'a, 'i>(&mut self, node: Node<'a, 'i>, tag: &str) -> Option<Node<'a, 'i>> {
        let mut all = node.children().filter(|c| c.is_element() && c.tag_name().name() == tag);
        let first = all.next();
        if all.next().is_some() {
            self.warn(format!("more than one {tag}: the first is taken"));
        }
        first
    }

    pub(super) fn text<'a>(&self, node: Node<'a, '_>, field: &str) -> Result<&'a str> {
        let tag = node.tag_name().name();
        let missing = || wrong(format!("{}: {tag} has no {field}", self.owner));
        node.attribute(field).ok_or_else(missing)
    }

    /// A number, where it is given.
    pub(super) fn number(&self, node: Node<'_, '_>, field: &str) -> Result<Option<f64>> {
        node.attribute(field).map(|text| self.parsed(field, text)).transpose()
    }

    fn parsed(&self, field: &str, text: &str) -> Result<f64> {
        let no_number = |_| wrong(format!("{}: {field}: '{text}' is no number", self.owner));
        text.trim().parse().map_err(no_number)
    }

    /// Three numbers, where they are given: surplus ones are left out, and one scale is that of all axes.
    pub(super) fn three(&mut self, node: Node<'_, '_>, field: &str) -> Result<Option<[f64; 3]>> {
        let Some(text) = node.attribute(field) else { return Ok(None) };
        let words: Vec<&str> = text.split_whitespace().collect();
        let [x, y, z] = match words[..] {
            [all] if field == "scale" => [all; 3],
            [x, y, z, ..] => [x, y, z],
            _ => return Err(wrong(format!("{}: {field}: '{text}' is not three", self.owner))),
        };
        if words.len() > 3 {
            self.warn(format!("{field} has {} numbers: the first three are taken", words.len()));
        }
        let parsed = |word| self.parsed(field, word);
        Ok(Some([parsed(x)?, parsed(y)?, parsed(z)?]))
    }

    /// The origin tag in `node`: roll, pitch and yaw turn about the fixed axes x, y and z in this order.
    pub(super) fn origin(&mut self, node: Node<'_, '_>) -> Result<Isometry3<f64>> {
        let Some(origin) = self.first(node, "origin") else { return Ok(Isometry3::identity()) };
        let xyz = self.three(origin, "xyz")?.unwrap_or_default();
        let rpy = self.three(origin, "rpy")?.unwrap_or_default();
        finite(&self.owner, "origin xyz", &xyz)?;
        finite(&self.owner, "origin rpy", &rpy)?;
        let turn = UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]);
        Ok(Isometry3::from_parts(Translation3::from(Vector3::from(xyz)), turn))
    }
}

#[cfg(test)]
mod tests {
    use super::super::KinematicTree;
    use crate::read_options::ReadOptions;

    #[test]
    fn what_is_plain_is_read_with_a_warning() {
        let xml = r#"<robot><link name="a"/><material name="m"/>
            <link name="b"><visual><geometry><mesh filename="gone.dae"/></geometry></visual>
                <inertial><origin xyz="0 0 1 7"/><mass value="2"/><inertia ixx="1" iyy="2" izz="3"/></inertial></link>
            <joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/><axis xyz="1 0 0"/>
                <limit lower="1" upper="0"/></joint></robot>"#;
        let robot = KinematicTree::from_urdf_str(xml, None).unwrap();
        let inertial = robot.links()[1].inertial.unwrap();
        assert_eq!((inertial.com.z, inertial.inertia[(1, 1)]), (1.0, 2.0));
        assert_eq!((robot.joints()[0].axis.y, robot.joints()[0].limits), (1.0, None));
        assert_eq!(
            robot.warnings(),
            [
                "link 'b': xyz has 4 numbers: the first three are taken",
                "link 'b': its inertia has no ixy, ixz, iyz: zero is taken",
                "joint 'j': more than one axis: the first is taken",
                "joint 'j': its limits are from 1 to 0, upside down: none is taken",
            ]
        );
    }

    #[test]
    fn what_cannot_be_read_is_left_out_where_that_is_wanted() {
        let xml = r#"<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous"><parent link="a"/><child link="b"/>
            <mimic joint="gone"/></joint></robot>"#;
        let error = KinematicTree::from_urdf_str(xml, None).unwrap_err().to_string();
        assert!(error.contains("joint 'gone', named by the mimic tag of joint 'j'"), "{error}");
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), xml).unwrap();
        let options = ReadOptions { partial: true, ..ReadOptions::default() };
        let robot = KinematicTree::from_urdf_file_with(file.path(), &options).unwrap();
        assert_eq!(robot.joint_names(), ["j"]);
        let warning = "joint 'j': there is no joint 'gone' that it could mimic: left out";
        assert_eq!(robot.warnings(), [warning]);
    }

    #[test]
    fn macros_are_named() {
        let space = r#"xmlns:xacro="http://www.ros.org/wiki/xacro""#;
        let read = |attributes: &str, content: &str| {
            let xml = format!("<robot name=\"r\" {attributes}>{content}</robot>");
            KinematicTree::from_urdf_str(&xml, None).map_err(|e| e.to_string())
        };
        let mesh = r#"<link name="a"><collision><geometry><mesh filename="$(find p)/a.stl"/></geometry></collision></link>"#;
        for (attributes, content) in [
            (space, r#"<xacro:include filename="a"/>"#),
            ("", r#"<xacro:include filename="a"/>"#),
            (space, r#"<link name="${side}_a"/>"#),
            ("", mesh),
        ] {
            let error = read(attributes, content).unwrap_err();
            assert!(error.contains("run `xacro FILE"), "{error}");
        }
        assert!(read(space, r#"<link name="a"/>"#).is_ok());
    }
}
