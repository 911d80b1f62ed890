//! The tree of bodies with their joints, geoms and sites.

use nalgebra::Isometry3;

use super::class::{Classes, MAIN};
use super::compiler::{Compiler, InertiaFrom};
use super::element::Element;
use super::error::MjcfError;
use super::geom::{Assets, Geom};
use super::inertial;
use super::joint::{self, Joint, JointKind};
use super::orientation;
use super::site::Site;
use crate::inertial::Inertial;

/// A rigid body.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its name, empty where it has none.
    pub name: String,
    /// The body that carries it, which comes before it; `None` is the world.
    pub parent: Option<usize>,
    /// Body frame → parent's frame, with all joints at their references.
    pub t_parent_body: Isometry3<f64>,
    /// Its joints towards the parent, the first nearest to it; without any it is fixed to the parent.
    pub joints: Vec<Joint>,
    /// Its mass and inertia, as written or as its geoms give it; `None` where it weighs nothing.
    pub inertial: Option<Inertial>,
    /// Its shapes.
    pub geoms: Vec<Geom>,
    /// Its marked places.
    pub sites: Vec<Site>,
    /// The share of its weight that is carried for it \[1\].
    pub gravity_compensation: f64,
}

/// The world and all bodies.
#[derive(Default)]
pub(super) struct Tree {
    pub(super) bodies: Vec<Body>,
    pub(super) geoms: Vec<Geom>,
    pub(super) sites: Vec<Site>,
}

/// Where an element is found.
#[derive(Clone, Copy)]
struct Spot {
    /// `None` is the world.
    body: Option<usize>,
    /// Frame of the enclosing `frame` elements → body frame.
    t_body_frame: Isometry3<f64>,
    /// The class of elements that name none.
    class: usize,
}

/// Reads the tree of `root`.
pub(super) fn read(
    root: &Element,
    compiler: &Compiler,
    classes: &Classes,
    assets: &Assets<'_>,
) -> Result<Tree, MjcfError> {
    let mut reader =
        Reader { compiler, classes, assets, tree: Tree::default(), weights: Vec::new() };
    for e in root.sections("worldbody") {
        let class = classes.index(e, "childclass", MAIN)?;
        reader.content(e, Spot { body: None, t_body_frame: Isometry3::identity(), class })?;
    }
    Ok(reader.tree)
}

struct Reader<'a> {
    compiler: &'a Compiler,
    classes: &'a Classes,
    assets: &'a Assets<'a>,
    tree: Tree,
    /// What the geoms of each body weigh.
    weights: Vec<Vec<Inertial>>,
}

impl Reader<'_> {
    /// What is in a body, in a frame or in the world.
    fn content(&mut self, e: &Element, spot: Spot) -> Result<(), MjcfError> {
        for child in &e.children {
            match child.tag.as_str() {
                "body" => self.body(child, spot)?,
                "frame" => {
                    let class = self.classes.index(child, "childclass", spot.class)?;
                    let t_body_frame = spot.t_body_frame * orientation::pose(child, self.compiler)?;
                    child.text("name");
                    self.content(child, Spot { t_body_frame, class, ..spot })?;
                }
                "joint" | "freejoint" => self.joint(child, spot)?,
                "geom" => self.geom(child, spot)?,
                "site" => self.site(child, spot)?,
                // Read with its body.
                "inertial" if spot.body.is_some() => continue,
                _ => continue,
            }
            if child.used() == super::element::Use::None {
                child.take();
            }
        }
        Ok(())
    }

    fn body(&mut self, e: &Element, spot: Spot) -> Result<(), MjcfError> {
        let t_parent_body = spot.t_body_frame * orientation::pose(e, self.compiler)?;
        let name = e.name();
        if name == "world" || (!name.is_empty() && self.tree.bodies.iter().any(|b| b.name == name))
        {
            return Err(e.duplicate("body"));
        }
        let index = self.tree.bodies.len();
        self.tree.bodies.push(Body {
            name,
            parent: spot.body,
            t_parent_body,
            joints: Vec::new(),
            inertial: None,
            geoms: Vec::new(),
            sites: Vec::new(),
            gravity_compensation: e.number("gravcomp")?.unwrap_or(0.0),
        });
        self.weights.push(Vec::new());
        let class = self.classes.index(e, "childclass", spot.class)?;
        let inside = Spot { body: Some(index), t_body_frame: Isometry3::identity(), class };
        self.content(e, inside)?;
        let written = inertial::written(e, self.compiler)?;
        let inferred = || Inertial::joined(&self.weights[index]);
        let inertial = match self.compiler.inertia_from {
            InertiaFrom::Geoms => inferred(),
            InertiaFrom::Either => written.or_else(inferred),
            InertiaFrom::Element => written,
        };
        self.tree.bodies[index].inertial = inertial::bounded(inertial, self.compiler);
        Ok(())
    }

    fn joint(&mut self, e: &Element, spot: Spot) -> Result<(), MjcfError> {
        let Some(index) = spot.body else {
            return Err(e.misplaced("the world has no joints"));
        };
        let joint = if e.tag == "freejoint" {
            joint::Spec::free(e, self.compiler)?
        } else {
            let mut spec = self.classes.of(e, spot.class)?.joint.clone();
            spec.read(e, self.compiler)?;
            spec.build(e, self.compiler, &spot.t_body_frame)?
        };
        let body = &self.tree.bodies[index];
        if joint.kind == JointKind::Free && (body.parent.is_some() || !body.joints.is_empty()) {
            return Err(e.misplaced("a free joint must be the only one, of a body in the world"));
        }
        if body.joints.iter().any(|j| j.kind == JointKind::Free) {
            return Err(e.misplaced("a free body has no other joint"));
        }
        let mut all = self.tree.bodies.iter().flat_map(|b| &b.joints);
        if !joint.name.is_empty() && all.any(|j| j.name == joint.name) {
            return Err(e.duplicate("joint"));
        }
        self.tree.bodies[index].joints.push(joint);
        Ok(())
    }

    fn geom(&mut self, e: &Element, spot: Spot) -> Result<(), MjcfError> {
        let mut spec = self.classes.of(e, spot.class)?.geom.clone();
        spec.read(e, self.compiler)?;
        let built = spec.build(e, self.compiler, self.assets, &spot.t_body_frame)?;
        let Some((geom, weight)) = built else { return Ok(()) };
        match spot.body {
            None => self.tree.geoms.push(geom),
            Some(index) => {
                self.tree.bodies[index].geoms.push(geom);
                self.weights[index].extend(weight);
            }
        }
        Ok(())
    }

    fn site(&mut self, e: &Element, spot: Spot) -> Result<(), MjcfError> {
        let mut spec = self.classes.of(e, spot.class)?.site.clone();
        spec.read(e, self.compiler)?;
        let site = spec.build(e, &spot.t_body_frame)?;
        match spot.body {
            None => self.tree.sites.push(site),
            Some(index) => self.tree.bodies[index].sites.push(site),
        }
        Ok(())
    }
}
