//! Names in a model and what refers to them.

use std::collections::BTreeSet;

use super::element::Element;

/// Kind of an element that others refer to by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum NamedReference {
    Body,
    Joint,
    Geom,
    Site,
    Frame,
    Camera,
    Light,
    Tendon,
    Actuator,
    Class,
    Asset,
    Other,
}

/// Names of one tree, by what has them.
pub(super) type Names = BTreeSet<(NamedReference, String)>;

/// Kind of element that the attribute `field` of `e` refers to; `None` where it is no reference.
pub(super) fn referred(e: &Element, field: &str) -> Option<NamedReference> {
    let of_object = |field: &str| match e.peek(field)? {
        "body" | "xbody" => Some(NamedReference::Body),
        "joint" => Some(NamedReference::Joint),
        "geom" => Some(NamedReference::Geom),
        "site" => Some(NamedReference::Site),
        "camera" => Some(NamedReference::Camera),
        "tendon" => Some(NamedReference::Tendon),
        "actuator" => Some(NamedReference::Actuator),
        _ => None,
    };
    Some(match field {
        "body" | "body1" | "body2" | "target" | "bodyname" => NamedReference::Body,
        "joint" | "joint1" | "joint2" | "jointinparent" => NamedReference::Joint,
        "site" | "site1" | "site2" | "refsite" | "slidersite" | "cranksite" | "sidesite" => {
            NamedReference::Site
        }
        "geom" | "geom1" | "geom2" => NamedReference::Geom,
        "tendon" | "tendon1" | "tendon2" => NamedReference::Tendon,
        "actuator" => NamedReference::Actuator,
        "camera" => NamedReference::Camera,
        "class" | "childclass" | "alias" => NamedReference::Class,
        "mesh" | "material" | "hfield" | "texture" => NamedReference::Asset,
        "objname" => of_object("objtype")?,
        "refname" => of_object("reftype")?,
        _ => return None,
    })
}

/// Kind of the element `e`, which is in `section`.
pub(super) fn named(e: &Element, section: &str) -> NamedReference {
    match (section, e.tag.as_str()) {
        ("worldbody", "body") => NamedReference::Body,
        ("worldbody", "joint" | "freejoint") => NamedReference::Joint,
        ("worldbody", "geom") => NamedReference::Geom,
        ("worldbody", "site") => NamedReference::Site,
        ("worldbody", "frame") => NamedReference::Frame,
        ("worldbody", "camera") => NamedReference::Camera,
        ("worldbody", "light") => NamedReference::Light,
        ("tendon", _) => NamedReference::Tendon,
        ("actuator", _) => NamedReference::Actuator,
        ("asset", _) => NamedReference::Asset,
        _ => NamedReference::Other,
    }
}

/// Adds the names of `e` and of all below it to `names`.
pub(super) fn collect(e: &Element, section: &str, names: &mut Names) {
    if let Some(name) = e.peek("name") {
        names.insert((named(e, section), name.to_owned()));
    }
    e.children.iter().for_each(|child| collect(child, section, names));
}

/// Whether `e` or something in it refers to one of `names`, and whether nothing refers to anything else.
pub(super) fn refers(e: &Element, names: &Names) -> (bool, bool) {
    let (mut any, mut all) = (false, true);
    for (field, _) in e.attributes() {
        let Some(kind) = referred(e, field)
            .filter(|k| !matches!(k, NamedReference::Class | NamedReference::Asset))
        else {
            continue;
        };
        let name = e.peek(field).unwrap_or_default();
        let known = names.contains(&(kind, name.to_owned()));
        any |= known;
        all &= known || (kind == NamedReference::Body && name == "world");
    }
    for child in &e.children {
        let (some, every) = refers(child, names);
        any |= some;
        all &= every;
    }
    (any, all)
}

/// Changes the names of `e` and of all in it, and its references to `names`, or to all where there are none, by `change`.
pub(super) fn rename(e: &mut Element, names: Option<&Names>, change: &dyn Fn(&str) -> String) {
    if let Some(name) = e.peek("name") {
        let changed = change(name);
        e.set("name", changed);
    }
    let fields: Vec<String> = e.attributes().map(|(name, _)| name.to_owned()).collect();
    for field in fields {
        let Some(kind) = referred(e, &field) else { continue };
        // The default class of an element that names a class is itself a name.
        let name = e.peek(&field).unwrap_or_default().to_owned();
        let is_world = kind == NamedReference::Body && name == "world";
        let known = names.is_none_or(|names| names.contains(&(kind, name.clone())));
        if known && !is_world && !name.is_empty() {
            e.set(&field, change(&name));
        }
    }
    e.children.iter_mut().for_each(|child| rename(child, names, change));
}
