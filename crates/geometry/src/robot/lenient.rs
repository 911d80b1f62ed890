//! URDF as its users' tools take it: what is plain though against the format is put right, with a warning, before it is read.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use roxmltree::Node;

use super::{Result, RobotError};

/// Error of a description that `xacro` has yet to expand.
const MACROS: &str = "it has xacro macros: run `xacro FILE > robot.urdf` first and read its output";

/// URDF text of links, collision shapes and joints alone that follows the format, and what was put right.
pub(super) fn put_right(xml: &str, partial: bool) -> Result<(String, Vec<String>)> {
    let wrong = |message: String| RobotError::Urdf { message };
    let document = roxmltree::Document::parse(xml).map_err(|e| {
        // The prefix may be declared nowhere.
        wrong(if xml.contains("<xacro:") { MACROS.to_owned() } else { e.to_string() })
    })?;
    let root = document.root_element();
    // The namespace alone says nothing: it stays in what xacro writes.
    let is_macro = |node: &Node<'_, '_>| {
        let mut values = node.attributes().map(|attribute| attribute.value());
        node.tag_name().namespace().is_some_and(|n| n.contains("xacro"))
            || values.any(|value| value.contains("${") || value.contains("$("))
    };
    if document.descendants().any(|node| is_macro(&node)) {
        return Err(wrong(MACROS.to_owned()));
    }
    if root.tag_name().name() != "robot" {
        return Err(wrong(format!(
            "the outermost element is '{}', not 'robot'",
            root.tag_name().name()
        )));
    }
    let of_joint = |node: &Node<'_, '_>| node.has_tag_name("joint");
    let joints = root.children().filter(of_joint).filter_map(|node| node.attribute("name"));
    let mut writer = Writer {
        out: String::new(),
        warnings: Vec::new(),
        owner: String::new(),
        joints: joints.map(str::to_owned).collect(),
        partial,
    };
    writer.open("robot", &[("name", root.attribute("name").unwrap_or_default())]);
    for node in root.children().filter(Node::is_element) {
        let name = node.attribute("name").unwrap_or_default();
        writer.owner = format!("{} '{name}'", node.tag_name().name());
        match node.tag_name().name() {
            "link" => writer.link(node)?,
            "joint" => writer.joint(node),
            _ => {}
        }
    }
    writer.out.push_str("</robot>");
    Ok((writer.out, writer.warnings))
}

struct Writer {
    out: String,
    warnings: Vec<String>,
    /// The link or joint that is written.
    owner: String,
    /// Names of all joints.
    joints: BTreeSet<String>,
    partial: bool,
}

impl Writer {
    fn warn(&mut self, what: impl std::fmt::Display) {
        self.warnings.push(format!("{}: {what}", self.owner));
    }

    fn start(&mut self, tag: &str, attributes: &[(&str, &str)]) {
        let _ = write!(self.out, "<{tag}");
        for (name, value) in attributes {
            let value = value.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;");
            let _ = write!(self.out, " {name}=\"{value}\"");
        }
    }

    fn open(&mut self, tag: &str, attributes: &[(&str, &str)]) {
        self.start(tag, attributes);
        self.out.push('>');
    }

    fn whole(&mut self, tag: &str, attributes: &[(&str, &str)]) {
        self.start(tag, attributes);
        self.out.push_str("/>");
    }

    /// The first element in `node` of that tag; others are warned about.
    fn first<'a, 'i>(&mut self, node: Node<'a, 'i>, tag: &str) -> Option<Node<'a, 'i>> {
        let mut all = node.children().filter(|c| c.is_element() && c.tag_name().name() == tag);
        let first = all.next();
        if all.next().is_some() {
            self.warn(format!("more than one {tag}: the first is taken"));
        }
        first
    }

    /// Copies attributes that are there.
    fn copied(&mut self, node: Node<'_, '_>, fields: &[&str]) {
        let given = fields.iter().filter_map(|f| Some((*f, node.attribute(*f)?)));
        self.whole(node.tag_name().name(), &given.collect::<Vec<_>>());
    }

    /// Three numbers: surplus ones are left out.
    fn three(&mut self, node: Node<'_, '_>, field: &str) -> Option<String> {
        let text = node.attribute(field)?;
        let words: Vec<&str> = text.split_whitespace().collect();
        if words.len() > 3 {
            self.warn(format!("{field} has {} numbers: the first three are taken", words.len()));
        }
        Some(words[..words.len().min(3)].join(" "))
    }

    fn origin(&mut self, node: Node<'_, '_>) {
        let Some(origin) = self.first(node, "origin") else { return };
        let fields = ["xyz", "rpy"].map(|field| (field, self.three(origin, field)));
        let given: Vec<_> = fields.iter().filter_map(|(f, v)| Some((*f, v.as_deref()?))).collect();
        self.whole("origin", &given);
    }

    fn link(&mut self, node: Node<'_, '_>) -> Result<()> {
        self.open("link", &[("name", node.attribute("name").unwrap_or_default())]);
        if let Some(inertial) = self.first(node, "inertial") {
            self.inertial(inertial);
        }
        for collision in node.children().filter(|c| c.has_tag_name("collision")) {
            let shape = self.first(collision, "geometry").and_then(|g| g.first_element_child());
            let tag = shape.map_or("", |shape| shape.tag_name().name());
            if !["box", "cylinder", "capsule", "sphere", "mesh"].contains(&tag) {
                let link = node.attribute("name").unwrap_or_default().to_owned();
                let reason = format!("collision shapes of the kind '{tag}' are not supported");
                if !self.partial {
                    return Err(RobotError::Shape { link, reason });
                }
                self.warn(format!("{reason}: left out"));
                continue;
            }
            self.open("collision", &[]);
            self.origin(collision);
            self.geometry(collision);
            self.out.push_str("</collision>");
        }
        self.out.push_str("</link>");
        Ok(())
    }

    fn inertial(&mut self, node: Node<'_, '_>) {
        self.open("inertial", &[]);
        self.origin(node);
        let mass = self.first(node, "mass");
        let mass = mass.and_then(|mass| mass.attribute("value"));
        if mass.is_none() {
            self.warn("its inertial has no mass: zero is taken");
        }
        self.whole("mass", &[("value", mass.unwrap_or("0"))]);
        let inertia = self.first(node, "inertia");
        let fields = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
        let missing: Vec<&str> = fields
            .into_iter()
            .filter(|field| inertia.is_none_or(|node| node.attribute(*field).is_none()))
            .collect();
        if !missing.is_empty() {
            self.warn(format!("its inertia has no {}: zero is taken", missing.join(", ")));
        }
        let value = |field| inertia.and_then(|node| node.attribute(field)).unwrap_or("0");
        self.whole("inertia", &fields.map(|field| (field, value(field))));
        self.out.push_str("</inertial>");
    }

    fn geometry(&mut self, node: Node<'_, '_>) {
        let shape = self.first(node, "geometry").and_then(|g| g.first_element_child());
        let Some(shape) = shape else { return };
        self.open("geometry", &[]);
        match shape.tag_name().name() {
            tag @ ("box" | "mesh") => {
                let field = if tag == "box" { "size" } else { "scale" };
                let value = self.three(shape, field);
                let mut given: Vec<(&str, &str)> = Vec::new();
                given.extend(shape.attribute("filename").map(|name| ("filename", name)));
                // One number scales all axes alike.
                let alike = value.as_ref().filter(|v| tag == "mesh" && !v.contains(' '));
                let value = alike.map(|v| format!("{v} {v} {v}")).or(value);
                given.extend(value.as_deref().map(|value| (field, value)));
                self.whole(tag, &given);
            }
            _ => self.copied(shape, &["radius", "length"]),
        }
        self.out.push_str("</geometry>");
    }

    fn joint(&mut self, node: Node<'_, '_>) {
        let [name, kind] = ["name", "type"].map(|f| node.attribute(f).unwrap_or_default());
        self.open("joint", &[("name", name), ("type", kind)]);
        self.origin(node);
        for tag in ["parent", "child"] {
            if let Some(link) = self.first(node, tag) {
                self.copied(link, &["link"]);
            }
        }
        let axis = self.first(node, "axis");
        if let Some(xyz) = axis.and_then(|axis| self.three(axis, "xyz")) {
            self.whole("axis", &[("xyz", &xyz)]);
        }
        if let Some(limit) = self.first(node, "limit") {
            self.limit(limit);
        }
        for (tag, fields) in [
            ("dynamics", &["damping", "friction"][..]),
            ("mimic", &["joint", "multiplier", "offset"]),
        ] {
            let Some(child) = self.first(node, tag) else { continue };
            let leader = child.attribute("joint").unwrap_or_default();
            if self.partial && tag == "mimic" && !self.joints.contains(leader) {
                self.warn(format!("there is no joint '{leader}' that it could mimic: left out"));
                continue;
            }
            self.copied(child, fields);
        }
        self.out.push_str("</joint>");
    }

    fn limit(&mut self, node: Node<'_, '_>) {
        let number = |field| node.attribute(field).and_then(|text| text.trim().parse::<f64>().ok());
        let [lower, upper] = ["lower", "upper"].map(|field| number(field).unwrap_or(0.0));
        let mut given: Vec<(&str, &str)> = Vec::new();
        if lower > upper {
            self.warn(format!(
                "its limits are from {lower} to {upper}, upside down: none is taken"
            ));
            given.extend([("lower", "-inf"), ("upper", "inf")]);
        } else {
            let fields = ["lower", "upper"].into_iter();
            given.extend(fields.filter_map(|f| Some((f, node.attribute(f)?))));
        }
        // Without these, against the format, no limit is meant.
        for field in ["effort", "velocity"] {
            given.push((field, node.attribute(field).unwrap_or("0")));
        }
        self.whole("limit", &given);
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
