//! Default classes: what elements are before their own attributes are read.

use super::compiler::Compiler;
use super::element::Element;
use super::error::MjcfError;
use super::{actuator, equality, geom, joint, material, mesh, site, tendon};

/// The outermost class, of elements without any.
pub(super) const MAIN: usize = 0;

/// The state in which elements of a class begin.
#[derive(Clone, Default)]
pub(super) struct Class {
    name: String,
    pub(super) joint: joint::Spec,
    pub(super) geom: geom::Spec,
    pub(super) site: site::Spec,
    pub(super) mesh: mesh::Spec,
    pub(super) material: material::Spec,
    pub(super) tendon: tendon::Spec,
    pub(super) equality: equality::Spec,
    pub(super) actuator: actuator::Spec,
}

/// All classes of a model.
pub(super) struct Classes(Vec<Class>);

impl Classes {
    pub(super) fn read(root: &Element, compiler: &Compiler) -> Result<Self, MjcfError> {
        let mut all = Self(vec![Class { name: "main".into(), ..Class::default() }]);
        for e in root.sections("default") {
            // Some files name the outermost class otherwise.
            if let Some(name) = e.text("class") {
                all.0[MAIN].name = name.to_owned();
            }
            all.fill(MAIN, e, compiler)?;
        }
        Ok(all)
    }

    /// Reads what is in `e` into the class `index`, then the classes within, which begin as it ended.
    fn fill(&mut self, index: usize, e: &Element, compiler: &Compiler) -> Result<(), MjcfError> {
        let class = &mut self.0[index];
        for child in e.children.iter().filter(|c| c.tag != "default") {
            let is_known = match child.tag.as_str() {
                "joint" => class.joint.read(child, compiler).map(|()| true),
                "geom" => class.geom.read(child, compiler).map(|()| true),
                "site" => class.site.read(child, compiler).map(|()| true),
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
            if self.0.iter().any(|c| c.name == name) {
                return Err(child.invalid("class", format!("'{name}' is the name of another")));
            }
            self.0.push(Class { name, ..self.0[index].clone() });
            self.fill(self.0.len() - 1, child, compiler)?;
        }
        Ok(())
    }

    /// The class that the attribute `field` of `e` names; `inherited` without it.
    pub(super) fn index(
        &self,
        e: &Element,
        field: &'static str,
        inherited: usize,
    ) -> Result<usize, MjcfError> {
        let Some(name) = e.text(field) else { return Ok(inherited) };
        self.0.iter().position(|c| c.name == name).ok_or_else(|| e.unknown(field, name))
    }

    /// The class of `e`: its own, or `inherited`.
    pub(super) fn of(&self, e: &Element, inherited: usize) -> Result<&Class, MjcfError> {
        Ok(&self.0[self.index(e, "class", inherited)?])
    }
}
