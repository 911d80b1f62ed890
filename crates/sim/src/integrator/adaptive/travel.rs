//! How far bodies may move before contacts could be passed over.

use super::planner::Probe;
use crate::body::RigidBody;
use crate::contact::patch::Patch;
use crate::state::State;
use crate::world::World;
use crate::world::body::Body;
use crate::world::contact_pair::ContactPair;

/// Part of a body's size by which its samples may always move.
const FREE_TRAVEL: f64 = 0.02;

/// For each contact, what its samples may do, if a force moves one of the bodies.
pub(super) struct Travel(Vec<Option<Limit>>);

/// What the samples of a contact may do.
struct Limit {
    /// Distance of the farthest one from the center of mass \[m\].
    radius: f64,
    /// How far they may always move \[m\].
    free: f64,
}

impl Travel {
    pub(super) fn new(world: &World) -> Self {
        let limit = |pair: &ContactPair| {
            let [body, other] =
                [pair.bodies.samples, pair.bodies.field].map(|id| &world.bodies[id]);
            // Bodies that no force moves need not feel each other.
            body.rigid().or(other.rigid())?;
            let radius = body.surface.as_ref()?.radius_about(&body.com());
            let size = |body: &Body| body.rigid().map_or(0.0, RigidBody::gyration_radius);
            let own = radius.max(size(body));
            Some(Limit { radius, free: FREE_TRAVEL * if own > 0.0 { own } else { size(other) } })
        };
        Self(world.contacts.iter().map(limit).collect())
    }

    fn limits<'a>(
        &'a self,
        world: &'a World,
    ) -> impl Iterator<Item = (&'a ContactPair, &'a Limit)> {
        let limited = world.contacts.iter().zip(&self.0);
        limited.filter_map(|(pair, limit)| Some((pair, limit.as_ref()?)))
    }

    /// The longest of the lengths `dt`, `dt`/2, … \[s\] in which bodies that go on as they move could not pass over a
    /// contact: no sample moves by more than its clearance and a small part of its body's size.
    pub(super) fn longest(&self, world: &World, states: &[State], mut dt: f64) -> f64 {
        // Both may fall, but not away from each other faster than one does.
        let fall = 0.5 * world.gravity.norm();
        for (pair, limit) in self.limits(world) {
            let state = world.seen_value(pair, states);
            let speed = state.speed_within(limit.radius);
            while limit.passes_over(world, pair, state, dt * (speed + dt * fall)) {
                dt *= 0.5;
            }
        }
        dt
    }

    /// Whether a step of `dt` \[s\] from `states` through `stages` may have passed over a contact.
    pub(super) fn passes_over(
        &self,
        world: &World,
        states: &[State],
        stages: &[Vec<State<Probe>>],
        dt: f64,
    ) -> bool {
        self.limits(world).any(|(pair, limit)| {
            let state = world.seen_value(pair, states);
            let speed = |state: State| state.speed_within(limit.radius);
            let speeds = stages.iter().map(|stage| speed(world.seen_value(pair, stage)));
            limit.passes_over(world, pair, state, dt * speeds.fold(speed(state), f64::max))
        })
    }
}

impl Limit {
    /// Whether samples of `pair`, whose field sees their body in `state`, may pass over a contact if they move by `travel` \[m\].
    fn passes_over(&self, world: &World, pair: &ContactPair, state: State, travel: f64) -> bool {
        let near = |patch: Patch<'_>| patch.is_near(pair.law().reach(), travel - self.free);
        travel > self.free && world.patch(pair, state).is_some_and(near)
    }
}
