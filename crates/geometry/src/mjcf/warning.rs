//! What of a model was not read.

use std::collections::BTreeMap;
use std::fmt;

use super::element::{Element, Use};
use super::error::Place;

/// A part of a model that was left out, at the first place where it occurs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Its element.
    pub place: Place,
    /// The attribute, where it is not the whole element.
    pub attribute: Option<String>,
    /// How often it occurs.
    pub count: usize,
    /// What became of it.
    pub reason: &'static str,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.place)?;
        if let Some(attribute) = &self.attribute {
            write!(f, "{attribute}: ")?;
        }
        write!(f, "{}", self.reason)?;
        if self.count > 1 { write!(f, " ({} times)", self.count) } else { Ok(()) }
    }
}

/// Attributes that change nothing but how a model looks or is listed.
const LOOKS: &[&str] = &[
    "class",
    "group",
    "material",
    "rgba",
    "width",
    "user",
    "shininess",
    "specular",
    "reflectance",
    "emission",
    "metallic",
    "roughness",
    "texture",
    "texrepeat",
    "texuniform",
    "smoothnormal",
    "texturedir",
    "usethread",
    "info",
];

/// Elements and attributes below `root` that nothing has asked for, and those asked for in vain, each kind once.
pub(super) fn warnings(root: &Element) -> Vec<Warning> {
    let mut found: Vec<Warning> = Vec::new();
    let mut known: BTreeMap<(String, Option<String>, &'static str), usize> = BTreeMap::new();
    let mut add = |element: &Element, attribute: Option<&str>, reason: &'static str| {
        let attribute = attribute.map(str::to_owned);
        let at =
            *known.entry((element.tag.clone(), attribute.clone(), reason)).or_insert(found.len());
        match found.get_mut(at) {
            Some(warning) => warning.count += 1,
            None => found.push(Warning { place: element.place(), attribute, count: 1, reason }),
        }
    };
    let mut open = vec![root];
    while let Some(element) = open.pop() {
        match element.used() {
            Use::None => {
                add(element, None, "not read");
                continue;
            }
            Use::Refused(reason) => {
                add(element, None, reason);
                continue;
            }
            Use::Read => {}
        }
        for (name, used) in element.attributes() {
            match used {
                Use::None if LOOKS.contains(&name) => {}
                Use::None => add(element, Some(name), "not read"),
                Use::Refused(reason) => add(element, Some(name), reason),
                Use::Read => {}
            }
        }
        open.extend(element.children.iter().rev());
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::Model;

    #[test]
    fn what_is_not_read_is_named_once() {
        let xml = "<mujoco><option cone=\"elliptic\"/>\n<worldbody><light/><light/><geom size=\"1\" rgba=\"1 0 0 1\" gap=\"0\"/>\n\
            <body><geom size=\"1\" gap=\"1\"/><replicate count=\"2\"><geom size=\"1\"/></replicate></body></worldbody>\n\
            <actuator><muscle name=\"m\" tendon=\"t\"/></actuator><sensor><gyro/></sensor></mujoco>";
        let model = Model::from_str(xml, None).unwrap();
        let found: Vec<String> = model.warnings.iter().map(ToString::to_string).collect();
        let expected = [
            "line 1: option: cone: not read",
            "line 2: light: not read (2 times)",
            "line 2: geom: gap: not read (2 times)",
            "line 3: replicate: not read",
            "line 4: muscle 'm': left out: actuators of this kind are not read",
            "line 4: sensor: not read",
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn looks_and_what_is_read_give_no_warnings() {
        let xml = "<mujoco><asset><material name=\"m\" shininess=\"1\"/></asset><worldbody><body><joint name=\"q\" range=\"0 1\"/>\
            <geom size=\"1\" material=\"m\" user=\"1\"/><site size=\"1\" type=\"box\" group=\"4\"/></body></worldbody>\
            <actuator><position joint=\"q\" kp=\"1\" group=\"1\"/></actuator></mujoco>";
        assert_eq!(Model::from_str(xml, None).unwrap().warnings, []);
    }
}
