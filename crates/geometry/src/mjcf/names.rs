//! Bodies, joints, tendons, sites and geoms by name.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Isometry3;

use super::element::Element;
use super::error::Result;
use super::joint::JointKind;
use super::tendon::Tendon;
use super::{Geom, JointIndex, Model};

/// The names that things of one kind have.
#[derive(Default)]
pub(super) struct Taken(BTreeSet<String>);

impl Taken {
    /// Adds the name of `e`, which no other of this `kind` may have; many may have none.
    pub(super) fn add(&mut self, e: &Element, kind: &'static str) -> Result<()> {
        let name = e.name();
        if name.is_empty() || self.0.insert(name) { Ok(()) } else { Err(e.duplicate(kind)) }
    }
}

/// Bodies, joints and sites by name.
pub(super) struct Names {
    /// `None` is the world.
    bodies: BTreeMap<String, Option<usize>>,
    joints: BTreeMap<String, JointIndex>,
    /// `None` are those that are not read.
    tendons: BTreeMap<String, Option<usize>>,
    /// The body that each is on, and its pose there.
    sites: BTreeMap<String, (Option<usize>, Isometry3<f64>)>,
    /// The body that each is on, and its place among that body's geoms.
    geoms: BTreeMap<String, (Option<usize>, usize)>,
}

impl Names {
    pub(super) fn new(model: &Model) -> Self {
        let mut names = Self {
            bodies: BTreeMap::from([("world".to_owned(), None)]),
            joints: BTreeMap::new(),
            tendons: BTreeMap::new(),
            sites: BTreeMap::new(),
            geoms: BTreeMap::new(),
        };
        for (place, geom) in model.world_geoms.iter().enumerate() {
            names.geoms.insert(geom.name.clone(), (None, place));
        }
        for site in &model.world_sites {
            names.sites.insert(site.name.clone(), (None, site.t_body_site));
        }
        for (b, body) in model.bodies.iter().enumerate() {
            names.bodies.insert(body.name.clone(), Some(b));
            for (j, joint) in body.joints.iter().enumerate() {
                names.joints.insert(joint.name.clone(), JointIndex { body: b, joint: j });
            }
            for (place, geom) in body.geoms.iter().enumerate() {
                names.geoms.insert(geom.name.clone(), (Some(b), place));
            }
            for site in &body.sites {
                names.sites.insert(site.name.clone(), (Some(b), site.t_body_site));
            }
        }
        // What has no name cannot be named.
        names.bodies.remove("");
        names.joints.remove("");
        names.sites.remove("");
        names.geoms.remove("");
        names
    }

    /// Adds the tendons of `root`, of which these have been read since.
    pub(super) fn add_tendons(&mut self, root: &Element, read: &[Tendon]) {
        let written = root.in_sections("tendon").map(|e| (e.name(), None));
        let read = read.iter().enumerate().map(|(t, tendon)| (tendon.name.clone(), Some(t)));
        self.tendons.extend(written.chain(read));
        self.tendons.remove("");
    }

    /// The tendon that the attribute `field` of `e` names; `None` where it is not read.
    pub(super) fn tendon(&self, e: &Element, field: &'static str) -> Result<Option<usize>> {
        find(&self.tendons, e, field)
    }

    /// The body that the attribute `field` of `e` names; `None` is the world.
    pub(super) fn body(&self, e: &Element, field: &'static str) -> Result<Option<usize>> {
        find(&self.bodies, e, field)
    }

    /// The joint that the attribute `field` of `e` names.
    pub(super) fn joint(&self, e: &Element, field: &'static str) -> Result<JointIndex> {
        find(&self.joints, e, field)
    }

    /// The hinge or slide that the attribute `field` of `e` names.
    pub(super) fn single_joint(
        &self,
        e: &Element,
        field: &'static str,
        model: &Model,
    ) -> Result<JointIndex> {
        let joint = self.joint(e, field)?;
        match model.joint(joint).kind {
            JointKind::Hinge | JointKind::Slide => Ok(joint),
            _ => Err(e.invalid(field, "names neither a hinge nor a slide")),
        }
    }

    /// The body of the geom that the attribute `field` of `e` names (`None` is the world), and the geom.
    pub(super) fn geom<'a>(
        &self,
        e: &Element,
        field: &'static str,
        model: &'a Model,
    ) -> Result<(Option<usize>, &'a Geom)> {
        let (body, place) = find(&self.geoms, e, field)?;
        let all = body.map_or(&model.world_geoms, |body| &model.bodies[body].geoms);
        Ok((body, &all[place]))
    }

    /// The site that the attribute `field` of `e` names: its body (`None` is the world) and its pose there.
    pub(super) fn site(
        &self,
        e: &Element,
        field: &'static str,
    ) -> Result<(Option<usize>, Isometry3<f64>)> {
        find(&self.sites, e, field)
    }
}

fn find<T: Copy>(all: &BTreeMap<String, T>, e: &Element, field: &'static str) -> Result<T> {
    let name = e.text(field).ok_or_else(|| e.missing(field))?;
    all.get(name).copied().ok_or_else(|| e.unknown(field, name))
}
