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

/// Things of one kind by name; those without one cannot be named.
pub(super) struct Table<T>(BTreeMap<String, T>);

impl<T: Copy> Table<T> {
    fn of<'a>(named: impl IntoIterator<Item = (&'a str, T)>) -> Self {
        let named = named.into_iter().filter(|(name, _)| !name.is_empty());
        Self(named.map(|(name, thing)| (name.to_owned(), thing)).collect())
    }

    /// The thing that the attribute `field` of `e` names.
    pub(super) fn get(&self, e: &Element, field: &'static str) -> Result<T> {
        let name = e.text(field).ok_or_else(|| e.missing(field))?;
        self.0.get(name).copied().ok_or_else(|| e.unknown(field, name))
    }
}

/// Bodies, joints, tendons, sites and geoms by name.
pub(super) struct Names {
    /// `None` is the world.
    pub(super) bodies: Table<Option<usize>>,
    pub(super) joints: Table<JointIndex>,
    /// `None` are those that are not read.
    pub(super) tendons: Table<Option<usize>>,
    /// The body that each is on, and its pose there.
    pub(super) sites: Table<(Option<usize>, Isometry3<f64>)>,
    /// The body that each is on, and its place among that body's geoms.
    geoms: Table<(Option<usize>, usize)>,
}

impl Names {
    pub(super) fn new(model: &Model) -> Self {
        let bodies = || model.bodies.iter().enumerate().map(|(b, body)| (Some(b), body));
        let sites = bodies().flat_map(|(b, body)| body.sites.iter().map(move |s| (b, s)));
        let sites = model.world_sites.iter().map(|s| (None, s)).chain(sites);
        let geoms = bodies().map(|(b, body)| (b, &body.geoms));
        let geoms = std::iter::once((None, &model.world_geoms)).chain(geoms);
        let geoms = geoms.flat_map(|(b, all)| {
            all.iter().enumerate().map(move |(place, geom)| (geom.name.as_str(), (b, place)))
        });
        let joints = model.joint_indices().map(|j| (model.joint(j).name.as_str(), j));
        let named = bodies().map(|(b, body)| (body.name.as_str(), b));
        Self {
            bodies: Table::of(std::iter::once(("world", None)).chain(named)),
            joints: Table::of(joints),
            tendons: Table::of([]),
            sites: Table::of(sites.map(|(b, s)| (s.name.as_str(), (b, s.t_body_site)))),
            geoms: Table::of(geoms),
        }
    }

    /// Adds the tendons of `root`, of which these have been read since.
    pub(super) fn add_tendons(&mut self, root: &Element, read: &[Tendon]) {
        let written: Vec<String> = root.in_sections("tendon").map(Element::name).collect();
        let written = written.iter().map(|name| (name.as_str(), None));
        let read = read.iter().enumerate().map(|(t, tendon)| (tendon.name.as_str(), Some(t)));
        self.tendons = Table::of(written.chain(read));
    }

    /// The hinge or slide that the attribute `field` of `e` names.
    pub(super) fn single_joint(
        &self,
        e: &Element,
        field: &'static str,
        model: &Model,
    ) -> Result<JointIndex> {
        let joint = self.joints.get(e, field)?;
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
        let (body, place) = self.geoms.get(e, field)?;
        let all = body.map_or(&model.world_geoms, |body| &model.bodies[body].geoms);
        Ok((body, &all[place]))
    }
}
