//! Contacts between two lists of bodies.

use std::sync::Arc;

use prehend_autodiff::Scalar;

use super::Model;
use super::body::Body;
use super::contact_group::{ContactGroup, ascending};
use super::contact_pair::{ContactBodies, ContactPair};
use crate::contact::dynamic::DynContactLaw;
use crate::contact::gap_smoothing::GapSmoothing;
use crate::error::BuildError;
use crate::handle::{BodyId, ContactId, ContactPlace};
use crate::surface::Surface;

impl Model {
    /// Lets every body of `a` touch every one of `b`; bodies that are in both touch each other, too. Two bodies touch as
    /// by [`add_symmetric_contact`](Model::add_symmetric_contact) where each has samples and a field, unless one is a
    /// ball, a single round sample: then that touches the field of the other, which is all there is to it.
    ///
    /// Contacts with bristles remember how: they are added one by one for all pairs, to [`contacts`](Model::contacts). All others make
    /// up one of [`contact_groups`](Model::contact_groups).
    ///
    /// # Errors
    /// If there is no such body; if two that forces may move against each other have no samples or no field to touch with; if there
    /// are no two such bodies; if the parameters of `smoothing` are out of their range.
    pub fn add_contacts_between(
        &mut self,
        a: &[BodyId],
        b: &[BodyId],
        law: Arc<dyn DynContactLaw>,
        smoothing: GapSmoothing,
    ) -> Result<ContactId, BuildError> {
        a.iter().chain(b).try_for_each(|body| self.body(*body).map(|_| ()))?;
        smoothing.check()?;
        let lists = [a, b].map(ascending);
        let first = self.first_contact(&lists)?;
        let group = ContactGroup::new(lists, ContactPair::new(first, law, smoothing));
        if group.contact.law().bristles().is_some() {
            let every = self.all_pairs(&group);
            return Ok(self.push_contacts(every));
        }
        self.contact_groups.push(group);
        Ok(ContactId(ContactPlace::Group(self.contact_groups.len() - 1)))
    }

    /// One of the contacts between two lists of bodies, if all of them can touch.
    fn first_contact(&self, lists: &[Arc<[BodyId]>; 2]) -> Result<ContactBodies, BuildError> {
        let mut first = None;
        // Bodies that can do the same need be asked once, or twice where they are to touch each other.
        let kind = |id: BodyId| {
            let body = &self.bodies[id];
            (body.surface.is_some(), body.field.is_some(), body.feels_forces())
        };
        let kinds = lists.each_ref().map(|list| {
            let mut found: Vec<BodyId> = Vec::new();
            for &id in list.iter() {
                if found.iter().filter(|other| kind(**other) == kind(id)).count() < 2 {
                    found.push(id);
                }
            }
            found
        });
        for &a in &kinds[0] {
            for &b in kinds[1].iter().filter(|b| **b != a) {
                if self.moves_against(a, b) {
                    first = first.or(Some(self.sides(a, b)?[0].0));
                }
            }
        }
        first.ok_or(BuildError::NoContacts)
    }

    /// All contacts of a group, one by one.
    fn all_pairs(&self, group: &ContactGroup) -> Vec<ContactPair> {
        let [a, b] = group.bodies();
        let both = |(a, b): &(BodyId, BodyId)| group.is_wanted(*a, *b);
        let pairs = a.iter().flat_map(|a| b.iter().map(move |b| (*a, *b))).filter(both);
        let pairs = pairs.filter(|(a, b)| self.moves_against(*a, *b));
        let contacts = pairs.flat_map(|(a, b)| self.sides(a, b).unwrap_or_default());
        contacts.map(|(bodies, weight)| group.pair(bodies, weight)).collect()
    }
}

impl<S: Scalar> Model<S> {
    /// True if a force may move one of two bodies against the other; links that share a joint overlap there and do not count.
    pub(crate) fn moves_against(&self, a: BodyId, b: BodyId) -> bool {
        (self.bodies[a].feels_forces() || self.bodies[b].feels_forces()) && !self.share_joint(a, b)
    }

    /// Samples and fields by which two bodies touch, with the weight of each contact.
    pub(crate) fn sides(
        &self,
        a: BodyId,
        b: BodyId,
    ) -> Result<Vec<(ContactBodies, f64)>, BuildError> {
        let there = ContactBodies { samples: a, field: b };
        let [on_b, on_a] = [there, there.swapped()].map(|ContactBodies { samples, field }| {
            self.bodies[samples].surface.is_some() && self.bodies[field].field.is_some()
        });
        match (on_b, on_a) {
            (true, true) if is_ball(&self.bodies[a]) => Ok(vec![(there, 1.0)]),
            (true, true) if is_ball(&self.bodies[b]) => Ok(vec![(there.swapped(), 1.0)]),
            (true, true) => Ok(vec![(there, 0.5), (there.swapped(), 0.5)]),
            (true, false) => Ok(vec![(there, 1.0)]),
            (false, true) => Ok(vec![(there.swapped(), 1.0)]),
            (false, false) => {
                let name = |id: BodyId| self.bodies[id].name.clone();
                Err(match [a, b].map(|id| self.bodies[id].surface.is_some()) {
                    [false, false] => BuildError::NoSamples { body: name(a) },
                    [true, _] => BuildError::NoField { body: name(b) },
                    [false, true] => BuildError::NoField { body: name(a) },
                })
            }
        }
    }
}

/// True if a body is one round sample.
fn is_ball<S: Scalar>(body: &Body<S>) -> bool {
    let single = |surface: &Arc<Surface>| surface.points().len() == 1 && surface.rounding() > 0.0;
    body.surface.as_ref().is_some_and(single)
}
