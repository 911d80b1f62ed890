//! Warnings of parts of a model that were not read.

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
    /// Reason, such as `not read`.
    pub reason: &'static str,
    /// Whether it changes masses, degrees of freedom, contacts or actuation.
    pub changes: bool,
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
const LOOKS: &str = "class group material rgba width user shininess specular reflectance emission metallic roughness texture texrepeat texuniform smoothnormal texturedir usethread info";

/// Elements that change nothing of how a model moves: what is drawn, measured or noted, and how MuJoCo allots memory and solves. Contacts are for the world to make.
const HARMLESS: &str =
    "visual statistic light camera texture skin custom size sensor extension flag lengthrange pair";

/// Attributes of the medium around a model, which there is none of.
const MEDIUM: &str = "density viscosity wind";

/// Attributes that change how a model moves where they are not read.
const DYNAMIC: &str =
    "armature damping stiffness springdamper scale massscale lengthrange delay nsample";

fn is_among(names: &str, name: &str) -> bool {
    names.split(' ').any(|one| one == name)
}

/// Elements and attributes below `root` that nothing has asked for, and those asked for in vain, each kind once. What only draws or measures is
/// passed over, and so is how MuJoCo solves, which is logged.
pub(super) fn warnings(root: &Element) -> Vec<Warning> {
    let mut found: Vec<Warning> = Vec::new();
    let mut known: BTreeMap<(String, Option<String>, &'static str), usize> = BTreeMap::new();
    let mut add = |element: &Element, attribute: Option<&str>, reason, changes| {
        let attribute = attribute.map(str::to_owned);
        let at =
            *known.entry((element.tag.clone(), attribute.clone(), reason)).or_insert(found.len());
        match found.get_mut(at) {
            Some(warning) => warning.count += 1,
            None => {
                let place = element.place();
                found.push(Warning { place, attribute, count: 1, reason, changes });
            }
        }
    };
    let mut passed: BTreeMap<&str, usize> = BTreeMap::new();
    let mut open = vec![(root, false)];
    while let Some((element, in_default)) = open.pop() {
        let tag = element.tag.as_str();
        if is_among(HARMLESS, tag) {
            *passed.entry(tag).or_default() += 1;
            continue;
        }
        // A class changes nothing but what is of it.
        let in_default = in_default || tag == "default";
        match element.used() {
            Use::None if tag == "deformable" => {}
            Use::None => {
                add(element, None, "not read", !in_default);
                continue;
            }
            Use::Refused(reason) => {
                add(element, None, reason, !in_default);
                continue;
            }
            Use::Read => {}
        }
        for (name, used) in element.attributes() {
            let changes = !in_default && is_among(DYNAMIC, name);
            match used {
                Use::None if is_among(LOOKS, name) => *passed.entry(name).or_default() += 1,
                Use::None if matches!(tag, "option" | "compiler") && !is_among(MEDIUM, name) => {
                    *passed.entry(name).or_default() += 1;
                }
                Use::None => add(element, Some(name), "not read", changes),
                Use::Refused(reason) => add(element, Some(name), reason, changes),
                Use::Read => {}
            }
        }
        open.extend(element.children.iter().rev().map(|child| (child, in_default)));
    }
    if !passed.is_empty() {
        let passed: Vec<String> = passed.iter().map(|(name, n)| format!("{name} ({n})")).collect();
        let file = root.place().file.map(|file| format!("{}: ", file.display()));
        let (file, passed) = (file.unwrap_or_default(), passed.join(", "));
        log::info!("{file}passed over, as only drawn, measured or of MuJoCo's solver: {passed}");
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::Model;
    use crate::read_options::ReadOptions;

    #[test]
    fn what_is_not_read_is_named_once() {
        let xml = "<mujoco><option cone=\"elliptic\" viscosity=\"1\"/>\n<worldbody><light/><light/><geom size=\"1\" rgba=\"1 0 0 1\" gap=\"0\"/>\n\
            <body><geom size=\"1\" gap=\"1\"/><composite/></body></worldbody>\n\
            <actuator><plugin name=\"m\" joint=\"t\"/></actuator><sensor><clock/></sensor></mujoco>";
        let error = Model::from_str(xml, None).unwrap_err().to_string();
        assert_eq!(
            error,
            "line 3: composite: not read: not supported (with `partial`, it is left out)"
        );
        let options = ReadOptions { partial: true, ..ReadOptions::default() };
        let model = Model::from_str_with(xml, None, &options).unwrap();
        let found: Vec<String> = model.warnings.iter().map(ToString::to_string).collect();
        let expected = [
            "line 1: option: viscosity: not read",
            "line 2: geom: gap: not read (2 times)",
            "line 3: composite: not read",
            "line 4: plugin 'm': left out: actuators of this kind are not read",
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
