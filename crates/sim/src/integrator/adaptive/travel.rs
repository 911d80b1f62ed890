//! How far bodies may move before contacts could be passed over.

use nalgebra::Point3;
use prehend_autodiff::Scalar;
use prehend_geometry::DistanceField;

use super::planner::Probe;
use crate::body::RigidBody;
use crate::contact::patch::Patch;
use crate::state::State;
use crate::surface::Surface;
use crate::world::World;
use crate::world::body::Body;
use crate::world::contact_pair::ContactPair;

/// Part of a body's size by which its samples may always move.
const FREE_TRAVEL: f64 = 0.02;

/// The longest of the lengths `dt`, `dt`/2, … \[s\] in which bodies that go on as they move could not pass over a contact:
/// no sample moves by more than its clearance and a small part of its body's size.
pub(super) fn longest(world: &World, states: &[State], mut dt: f64) -> f64 {
    for side in sides(world) {
        // Both may fall, but not away from each other faster than one does.
        let fall = 0.5 * world.gravity.norm();
        let speed = side.speed(world, states);
        while side.passes_over(world, states, dt * (speed + dt * fall)) {
            dt *= 0.5;
        }
    }
    dt
}

/// Whether a step of `dt` \[s\] from `states` through `stages` may have passed over a contact.
pub(super) fn passes_over(
    world: &World,
    states: &[State],
    stages: &[Vec<State<Probe>>],
    dt: f64,
) -> bool {
    sides(world).any(|side| {
        let speeds = stages.iter().map(|stage| side.speed(world, stage));
        side.passes_over(world, states, dt * speeds.fold(side.speed(world, states), f64::max))
    })
}

/// The samples of a contact that may move.
struct Side<'a> {
    pair: &'a ContactPair,
    surface: &'a Surface,
    field: &'a dyn DistanceField,
    com: Point3<f64>,
    /// Distance of the farthest sample from the center of mass \[m\].
    radius: f64,
    /// What samples may always move \[m\].
    free: f64,
}

fn sides(world: &World) -> impl Iterator<Item = Side<'_>> {
    world.contacts.iter().filter_map(|pair| {
        let bodies = [pair.bodies.samples, pair.bodies.field].map(|id| &world.bodies[id]);
        let [body, other] = bodies;
        // Bodies that no force moves need not feel each other.
        bodies.iter().find(|body| body.rigid().is_some())?;
        let (surface, field) = (body.surface.as_deref()?, other.field.as_deref()?);
        let radius = surface.radius_about(&body.com());
        let size = |body: &Body| body.rigid().map_or(0.0, RigidBody::gyration_radius);
        let own = radius.max(size(body));
        let free = FREE_TRAVEL * if own > 0.0 { own } else { size(other) };
        Some(Side { pair, surface, field, com: body.com(), radius, free })
    })
}

impl Side<'_> {
    /// The largest speed of a sample as the field sees it \[m/s\].
    fn speed<S: Scalar>(&self, world: &World, states: &[State<S>]) -> f64 {
        let state = world.seen_value(self.pair, states);
        state.linear.norm() + self.radius * state.angular.norm()
    }

    /// Whether samples that move by `travel` \[m\] from `states` may pass over a contact.
    fn passes_over(&self, world: &World, states: &[State], travel: f64) -> bool {
        let Self { pair, surface, field, com, free, .. } = *self;
        let (state, smoothing) = (world.seen_value(pair, states), pair.smoothing);
        travel > free
            && Patch { surface, com, state, field, smoothing }
                .is_near(pair.law().reach(), travel - free)
    }
}
