//! Default classes: what elements are before their own attributes are read.

use std::collections::BTreeMap;

use super::compiler::Compilers;
use super::element::Element;
use super::error::{MjcfError, Result};
use super::{actuator, equality, geom, joint, material, mesh, site, tendon};
use crate::limits::MAX_MJCF_CLASSES;

/// The outermost class, of elements without any.
pub(super) const MAIN: usize = 0;

/// The state in which elements of a class begin.
#[derive(Clone, Default)]
pub(super) struct Class {
    pub(super) joint: joint::JointSpec,
    pub(super) geom: geom::GeomSpec,
    pub(super) site: site::SiteSpec,
    pub(super) mesh: mesh::MeshSpec,
    pub(super) material: material::MaterialSpec,
    pub(super) tendon: tendon::TendonSpec,
    pub(super) equality: equality::EqualitySpec,
    pub(super) actuator: actuator::ActuatorSpec,
}

/// All classes of a model.
pub(super) struct Classes {
    all: Vec<Class>,
    names: BTreeMap<String, usize>,
}

impl Classes {
    pub(super) fn read(root: &Element, compilers: &Compilers) -> Result<Self> {
        let names = BTreeMap::from([("main".to_owned(), MAIN)]);
        let mut all = Self { all: vec![Class::default()], names };
        for e in root.sections("default") {
            // An attached model has an outermost class of its own.
            let index = if e.scope == 0 { MAIN } else { all.all.len() };
            if index > MAIN {
                all.all.push(Class::default());
            }
            // Some files name the outermost class otherwise.
            for name in [e.text("class"), e.text("alias")].into_iter().flatten() {
                all.names.insert(name.to_owned(), index);
            }
            all.fill(index, e, compilers)?;
        }
        Ok(all)
    }

    /// Reads what is in `e` into the class `index`, then the classes within, which begin as it ended.
    fn fill(&mut self, index: usize, e: &Element, compilers: &Compilers) -> Result<()> {
        let class = &mut self.all[index];
        for child in e.children.iter().filter(|c| c.tag != "default") {
            let is_known = match child.tag.as_str() {
                "joint" => class.joint.read(child, compilers.of(child)).map(|()| true),
                "geom" => class.geom.read(child, compilers.of(child)).map(|()| true),
                "site" => class.site.read(child, compilers.of(child)).map(|()| true),
                "mesh" => class.mesh.read(child).map(|()| true),
                "material" => class.material.read(child).map(|()| true),
                "tendon" => class.tendon.read(child).map(|()| true),
                "equality" => class.equality.read(child).map(|()| true),
                _ => class.actuator.read_default(child),
            }?;
            if is_known {
                child.take();
            }
        }
        for child in e.sections("default") {
            let name = child.text("class").ok_or_else(|| child.missing("class"))?.to_owned();
            let next = self.all.len();
            if next == MAX_MJCF_CLASSES {
                let (what, count) = ("default classes", next + 1);
                return Err(MjcfError::TooLarge { what, count, limit: MAX_MJCF_CLASSES });
            }
            if self.names.insert(name, next).is_some() {
                return Err(child.invalid("class", "is the name of another"));
            }
            self.all.push(self.all[index].clone());
            self.fill(next, child, compilers)?;
        }
        Ok(())
    }

    /// The class that the attribute `field` of `e` names; `inherited` without it.
    pub(super) fn index(
        &self,
        e: &Element,
        field: &'static str,
        inherited: usize,
    ) -> Result<usize> {
        let Some(name) = e.text(field) else { return Ok(inherited) };
        self.names.get(name).copied().ok_or_else(|| e.unknown(field, name))
    }

    /// The class of `e`: its own, or `inherited`.
    pub(super) fn of(&self, e: &Element, inherited: usize) -> Result<&Class> {
        Ok(&self.all[self.index(e, "class", inherited)?])
    }
}

#[cfg(test)]
mod tests {
    use super::super::Model;

    fn model(defaults: &str, body: &str) -> Result<Model, String> {
        let xml = format!(
            "<mujoco>{defaults}<worldbody><body name=\"b\" childclass=\"a\">{body}</body></worldbody></mujoco>"
        );
        Model::from_str(&xml, None).map_err(|e| e.to_string())
    }

    const CLASSES: &str = r#"<default><geom size="1 2 3" friction="0.5 0.1"/><joint damping="1" armature="2"/>
        <default class="c"><joint damping="9"/></default>
        <default class="a"><joint damping="3"/>
          <default class="b"><joint armature="4"/><geom type="box" friction="0.7"/></default>
          <joint frictionloss="5"/></default></default>"#;

    #[test]
    fn classes_begin_as_their_outer_class_ended() {
        let body = "<joint name=\"plain\"/><joint name=\"inner\" class=\"b\"/>\
            <joint name=\"main\" class=\"main\" axis=\"1 0 0\"/><geom/><geom class=\"b\" size=\"0.5\"/>";
        let model = model(CLASSES, body).unwrap();
        let of = |name: &str| {
            let joint = model.joint(model.joint_index(name).unwrap());
            [joint.damping, joint.armature, joint.friction_loss]
        };
        assert_eq!(of("plain"), [3.0, 2.0, 5.0]);
        // What follows the inner class in the file is in it, too.
        assert_eq!(of("inner"), [3.0, 4.0, 5.0]);
        assert_eq!(of("main"), [1.0, 2.0, 0.0]);
        let geoms = &model.bodies[0].geoms;
        assert_eq!(geoms[0].friction, [0.5, 0.1, 0.0001]);
        // The first number is its own, the rest is its class's.
        assert_eq!(geoms[1].friction, [0.7, 0.1, 0.0001]);
        let super::super::Shape::Box { half_extents } = geoms[1].shape else { panic!() };
        assert_eq!(half_extents.as_slice(), [0.5, 2.0, 3.0]);
    }

    #[test]
    fn the_nearest_childclass_counts() {
        let body = "<frame childclass=\"c\"><geom/><body><joint name=\"framed\"/><geom/></body></frame>\
            <body><joint name=\"inherited\"/><geom/></body><body childclass=\"b\"><joint name=\"own\"/><geom/></body>";
        let model = model(CLASSES, body).unwrap();
        let damping = |name: &str| model.joint(model.joint_index(name).unwrap()).damping;
        assert_eq!(["framed", "inherited", "own"].map(damping), [9.0, 3.0, 3.0]);
    }

    #[test]
    fn classes_are_named_once_and_exist() {
        let error = |defaults: &str, body: &str| model(defaults, body).unwrap_err();
        assert!(error(CLASSES, "<geom class=\"x\"/>").contains("class names 'x', which does not"));
        assert!(error("", "").contains("body 'b': childclass names 'a'"));
        let twice = "<default><default class=\"a\"/><default class=\"a\"/></default>";
        assert!(error(twice, "").contains("default: class is the name of another"));
        assert!(error("<default><default/></default>", "").contains("class is missing"));
        let many: String = (0..5000).map(|k| format!("<default class=\"{k}\"/>")).collect();
        assert!(error(&format!("<default>{many}</default>"), "").contains("default classes"));
    }

    #[test]
    fn an_orientation_of_another_form_replaces_that_of_the_class() {
        let defaults =
            "<default><default class=\"a\"><geom euler=\"0 0 90\" size=\"1\"/></default></default>";
        let model = model(defaults, "<geom/><geom quat=\"0 1 0 0\"/>").unwrap();
        let k = |g: usize| model.bodies[0].geoms[g].t_body_geom.rotation.quaternion().coords;
        assert!((k(0).z - 0.5_f64.sqrt()).abs() < 1e-15 && (k(1).x - 1.0).abs() < 1e-15);
    }
}
