//! How far bodies may move before contacts could be passed over.

use crate::body::RigidBody;
use crate::contact::patch::Patch;
use crate::state::State;
use crate::world::World;
use crate::world::contact_pair::ContactPair;

/// Part of a body's size by which its samples may always move.
const PART: f64 = 0.02;

/// The longest of the lengths `dt`, `dt`/2, … \[s\] in which no sample moves by more than its clearance and a small part of its
/// body's size.
pub(super) fn longest(world: &World, states: &[State], dt: f64) -> f64 {
    world.contacts.iter().fold(dt, |dt, pair| longest_of(world, pair, states, dt))
}

fn longest_of(world: &World, pair: &ContactPair, states: &[State], mut dt: f64) -> f64 {
    let (body, other) = (&world.bodies[pair.bodies.samples], &world.bodies[pair.bodies.field]);
    let (Some(surface), Some(field)) = (&body.surface, &other.field) else { return dt };
    let (com, state) = (body.com(), world.seen_value(pair, states));
    let radius = surface.radius_about(&com);
    let gyration = [body, other].map(|b| b.rigid().map_or(0.0, RigidBody::gyration_radius));
    let free = PART * gyration.into_iter().fold(radius, f64::max);
    let speed = state.linear.norm() + radius * state.angular.norm();
    // Both may fall, but not away from each other faster than one does.
    let travel = |dt: f64| dt * (speed + 0.5 * dt * world.gravity.norm()) - free;
    let patch = Patch { surface, com, state, field: field.as_ref(), smoothing: pair.smoothing };
    while travel(dt) > 0.0 && patch.is_near(pair.law().reach(), travel(dt)) {
        dt *= 0.5;
    }
    dt
}
