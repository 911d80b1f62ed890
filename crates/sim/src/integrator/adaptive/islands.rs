//! Bodies that can feel each other, apart from all others.

use prehend_autodiff::Scalar;

use crate::body_state::{BodyState, Rows};
use crate::handle::BodyId;
use crate::world::World;
use crate::world::broad_phase::CandidateContact;
use crate::world::contact_pair::{ContactBodies, ContactPair};

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
    /// The islands of the bodies of `world` with these contacts, in the order of their first free bodies.
    pub(super) fn all(world: &World, contacts: &[ContactPair]) -> Vec<Self> {
        let mut roots: Vec<usize> = (0..world.bodies.len()).collect();
        for ContactPair { bodies, .. } in contacts {
            let ends = [bodies.samples, bodies.field];
            if ends.iter().all(|id| world.bodies[*id].feels_forces()) {
                join(&mut roots, ends);
            }
        }
        for articulation in &world.articulations {
            articulation.bodies().windows(2).for_each(|pair| join(&mut roots, [pair[0], pair[1]]));
        }
        for bushing in &world.bushings {
            if bushing.bodies.iter().all(|id| world.bodies[*id].feels_forces()) {
                join(&mut roots, bushing.bodies);
            }
        }
        let mut place = vec![None; world.bodies.len()];
        let mut islands: Vec<Self> = Vec::new();
        for id in world.moved_bodies() {
            let root = root_of(&mut roots, id.index());
            let place = *place[root].get_or_insert_with(|| {
                islands.push(Self::default());
                islands.len() - 1
            });
            islands[place].bodies.push(id);
        }
        for (index, articulation) in world.articulations.iter().enumerate() {
            let body = articulation.bodies().first();
            if let Some(place) = body.and_then(|id| place[root_of(&mut roots, id.index())]) {
                islands[place].articulations.push(index);
                islands[place].joints.extend(world.joint_range(index));
            }
        }
        let mut deflection = world.joint_places().end;
        for (index, pair) in contacts.iter().enumerate() {
            let ends = [pair.bodies.samples, pair.bodies.field];
            let free = ends.into_iter().find(|id| world.bodies[*id].feels_forces());
            let sticks = pair.law().bristles().is_some();
            if let Some(place) = free.and_then(|id| place[root_of(&mut roots, id.index())]) {
                let island = &mut islands[place];
                island.contacts.push(index);
                island.deflections.extend(sticks.then_some(deflection));
                let fixed = ends.into_iter().filter(|id| !world.bodies[*id].feels_forces());
                island.bodies.extend(fixed);
            }
            deflection += usize::from(sticks);
        }
        for bushing in &world.bushings {
            let (moved, fixed): (Vec<BodyId>, Vec<BodyId>) =
                bushing.bodies.iter().partition(|id| world.bodies[**id].feels_forces());
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

    /// Its bodies and contacts as a world, each body at its place among [`bodies`](Self::bodies); `contacts` are those that
    /// it was found by.
    pub(super) fn world<S: Scalar>(
        &self,
        world: &World<S>,
        contacts: &[ContactPair<S>],
    ) -> World<S> {
        let body = |id: BodyId| BodyId(self.bodies.partition_point(|own| *own < id));
        let contact = |index: &usize| {
            let mut pair = contacts[*index].clone();
            let ContactBodies { samples, field } = pair.bodies;
            pair.bodies = ContactBodies { samples: body(samples), field: body(field) };
            pair
        };
        World {
            bodies: self.bodies.iter().map(|id| world.bodies[*id].clone()).collect(),
            contacts: self.contacts.iter().map(contact).collect(),
            contact_groups: Vec::new(),
            articulations: self
                .articulations
                .iter()
                .map(|index| world.articulations[*index].with_bodies(body))
                .collect(),
            joint_forces: world
                .joint_forces
                .iter()
                .filter(|force| force.axes.iter().all(|(axis, _)| self.has(axis.link)))
                .map(|force| force.with_bodies(body))
                .collect(),
            bushings: world
                .bushings
                .iter()
                .filter(|bushing| bushing.bodies.iter().all(|id| self.has(*id)))
                .filter(|bushing| bushing.bodies.iter().any(|id| world.bodies[*id].feels_forces()))
                .map(|bushing| bushing.with_bodies(body))
                .collect(),
            transmissions: world.transmissions.with_bodies(|id| self.has(id), body),
            gravity: world.gravity,
        }
    }

    /// Places of its states, in the order of its world, among those of all.
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
