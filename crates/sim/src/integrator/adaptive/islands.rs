//! Bodies that can feel each other, apart from all others.

use prehend_autodiff::Scalar;

use crate::body_state::{BodyState, Rows};
use crate::handle::BodyId;
use crate::model::Model;
use crate::model::broad_phase::CandidateContact;
use crate::model::contact_pair::{ContactBodies, ContactPair};

/// Bodies that are linked by contacts or joints, and what they touch that no force moves. What happens to them depends on no others.
#[derive(Default)]
pub(super) struct Island {
    /// In ascending order.
    pub(super) bodies: Vec<BodyId>,
    /// Places among the contacts, in ascending order.
    contacts: Vec<usize>,
    /// Its articulations, and the places of their joints among the states.
    articulations: Vec<usize>,
    joints: Vec<usize>,
    /// Places of the deflections of its contacts among the states.
    deflections: Vec<usize>,
}

/// Key that tells one island from another.
#[derive(Eq, Hash, PartialEq)]
pub(super) struct Links {
    bodies: Vec<BodyId>,
    contacts: Vec<(usize, ContactBodies)>,
}

impl Island {
    /// The islands of the bodies of `model` with these contacts, in the order of their first free bodies.
    pub(super) fn all(model: &Model, contacts: &[ContactPair]) -> Vec<Self> {
        let mut roots: Vec<usize> = (0..model.bodies.len()).collect();
        for ContactPair { bodies, .. } in contacts {
            let ends = [bodies.samples, bodies.field];
            if ends.iter().all(|id| model.bodies[*id].feels_forces()) {
                join(&mut roots, ends);
            }
        }
        for articulation in &model.articulations {
            articulation.bodies().windows(2).for_each(|pair| join(&mut roots, [pair[0], pair[1]]));
        }
        for bushing in &model.bushings {
            if bushing.bodies.iter().all(|id| model.bodies[*id].feels_forces()) {
                join(&mut roots, bushing.bodies);
            }
        }
        let mut place = vec![None; model.bodies.len()];
        let mut islands: Vec<Self> = Vec::new();
        for id in model.moved_bodies() {
            let root = root_of(&mut roots, id.index());
            let place = *place[root].get_or_insert_with(|| {
                islands.push(Self::default());
                islands.len() - 1
            });
            islands[place].bodies.push(id);
        }
        for (index, articulation) in model.articulations.iter().enumerate() {
            let body = articulation.bodies().first();
            if let Some(place) = body.and_then(|id| place[root_of(&mut roots, id.index())]) {
                islands[place].articulations.push(index);
                islands[place].joints.extend(model.joint_range(index));
            }
        }
        let mut deflection = model.joint_places().end;
        for (index, pair) in contacts.iter().enumerate() {
            let ends = [pair.bodies.samples, pair.bodies.field];
            let free = ends.into_iter().find(|id| model.bodies[*id].feels_forces());
            let sticks = pair.law().bristles().is_some();
            if let Some(place) = free.and_then(|id| place[root_of(&mut roots, id.index())]) {
                let island = &mut islands[place];
                island.contacts.push(index);
                island.deflections.extend(sticks.then_some(deflection));
                let fixed = ends.into_iter().filter(|id| !model.bodies[*id].feels_forces());
                island.bodies.extend(fixed);
            }
            deflection += usize::from(sticks);
        }
        for bushing in &model.bushings {
            let (moved, fixed): (Vec<BodyId>, Vec<BodyId>) =
                bushing.bodies.iter().partition(|id| model.bodies[**id].feels_forces());
            let root = moved.first().map(|id| root_of(&mut roots, id.index()));
            if let Some(place) = root.and_then(|root| place[root]) {
                islands[place].bodies.extend(fixed);
            }
        }
        for island in &mut islands {
            island.bodies.sort_unstable();
            island.bodies.dedup();
        }
        islands
    }

    /// Key of the island: its bodies; of contacts from index `single` on, also group and bodies.
    pub(super) fn links(&self, single: usize, candidates: &[CandidateContact]) -> Links {
        let candidates =
            self.contacts.iter().filter_map(|i| candidates.get(i.checked_sub(single)?));
        let contacts = candidates.map(|contact| (contact.group, contact.bodies)).collect();
        Links { bodies: self.bodies.clone(), contacts }
    }

    /// Its bodies and contacts as a model, each body at its place among [`bodies`](Self::bodies); `contacts` are those that
    /// it was found by.
    pub(super) fn model<S: Scalar>(
        &self,
        model: &Model<S>,
        contacts: &[ContactPair<S>],
    ) -> Model<S> {
        let body = |id: BodyId| BodyId(self.bodies.partition_point(|own| *own < id));
        let contact = |index: &usize| {
            let mut pair = contacts[*index].clone();
            let ContactBodies { samples, field } = pair.bodies;
            pair.bodies = ContactBodies { samples: body(samples), field: body(field) };
            pair
        };
        Model {
            bodies: self.bodies.iter().map(|id| model.bodies[*id].clone()).collect(),
            contacts: self.contacts.iter().map(contact).collect(),
            contact_groups: Vec::new(),
            articulations: self
                .articulations
                .iter()
                .map(|index| model.articulations[*index].with_bodies(body))
                .collect(),
            joint_forces: model
                .joint_forces
                .iter()
                .filter(|force| force.axes.iter().all(|(axis, _)| self.has(axis.link)))
                .map(|force| force.with_bodies(body))
                .collect(),
            bushings: model
                .bushings
                .iter()
                .filter(|bushing| bushing.bodies.iter().all(|id| self.has(*id)))
                .filter(|bushing| bushing.bodies.iter().any(|id| model.bodies[*id].feels_forces()))
                .map(|bushing| bushing.with_bodies(body))
                .collect(),
            transmissions: model.transmissions.with_bodies(|id| self.has(id), body),
            gravity: model.gravity,
        }
    }

    /// Places of its states, in the order of its model, among those of all.
    pub(super) fn places(&self) -> impl Iterator<Item = usize> {
        let bodies = self.bodies.iter().map(|id| id.index());
        bodies.chain(self.joints.iter().copied()).chain(self.deflections.iter().copied())
    }

    fn has(&self, body: BodyId) -> bool {
        self.bodies.binary_search(&body).is_ok()
    }

    /// Its states out of those of all.
    pub(super) fn states<S: Scalar>(&self, states: &Rows<S>) -> Vec<BodyState<S>> {
        self.places().map(|place| states[place]).collect()
    }
}

/// Makes one island of two.
fn join(roots: &mut [usize], ends: [BodyId; 2]) {
    let [a, b] = ends.map(|id| root_of(roots, id.index()));
    roots[a.max(b)] = a.min(b);
}

/// The first body of those that `index` is linked with.
fn root_of(roots: &mut [usize], mut index: usize) -> usize {
    while roots[index] != index {
        roots[index] = roots[roots[index]];
        index = roots[index];
    }
    index
}
