//! When in a step a contact begins or ends, where forces have kinks.

use prehend_geometry::FieldSample;

use crate::contact::gap_smoothing::GapSmoothing;
use crate::contact::patch::Patch;
use crate::state::State;
use crate::surface::SurfacePoint;
use crate::world::World;
use crate::world::contact_pair::ContactPair;

/// Time into a step of `dt` \[s\] from `start` to `end` at which the first sample enters or leaves the reach of its
/// contact's law without smoothing, but not before `earliest` \[s\].
pub(super) fn first(
    world: &World,
    start: &[State],
    end: &[State],
    dt: f64,
    earliest: f64,
) -> Option<f64> {
    let hard = |pair: &&ContactPair| !matches!(pair.smoothing, GapSmoothing::Softplus { .. });
    let times = world.contacts.iter().filter(hard);
    let times = times.filter_map(|pair| first_of(world, pair, [start, end], dt, earliest));
    times.min_by(f64::total_cmp)
}

fn first_of(
    world: &World,
    pair: &ContactPair,
    ends: [&[State]; 2],
    dt: f64,
    earliest: f64,
) -> Option<f64> {
    let seen = ends.map(|states| world.seen_value(pair, states));
    let patch = world.patch(pair, seen[0])?;
    let Patch { surface, com, field, .. } = patch;
    let radius = surface.radius_about(&com);
    let [before, after] = seen.each_ref().map(|state| state.speed_within(radius));
    let reach = pair.law().reach();
    let near = patch.near(reach, dt * before.max(after));
    let time = |point: &SurfacePoint| {
        let [from, to] = seen.map(|state| {
            let arm = state.pose.rotation * (point.position - com);
            let place = (state.pose.translation.vector + arm).into();
            let FieldSample { distance, gradient, .. } = field.sample(&place, f64::INFINITY)?;
            let rate = gradient.dot(&(state.linear + state.angular.cross(&arm)));
            Some([distance - point.radius - reach, rate])
        });
        let time = crossing(from?, to?, dt)?;
        (time > earliest).then_some(time)
    };
    near.points().iter().filter_map(time).min_by(f64::total_cmp)
}

/// Where the cubic with a value and a slope at 0 and at `dt` changes its sign, if the values differ in theirs.
fn crossing([a, rate_a]: [f64; 2], [b, rate_b]: [f64; 2], dt: f64) -> Option<f64> {
    if (a > 0.0) == (b > 0.0) {
        return None;
    }
    let (da, db) = (rate_a * dt, rate_b * dt);
    let value = |t: f64| {
        let s = 1.0 - t;
        s * s * ((1.0 + 2.0 * t) * a + t * da) + t * t * ((1.0 + 2.0 * s) * b - s * db)
    };
    let (mut low, mut high) = (0.0, 1.0);
    // By halves: as many as a number has digits.
    for _ in 0..52 {
        let middle = 0.5 * (low + high);
        if (value(middle) > 0.0) == (a > 0.0) { low = middle } else { high = middle }
    }
    Some(high * dt)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_crosses_where_it_does() {
        // 2 − 3t − 4t² + t³ from 0 to 2.
        let value = |t: f64| 2.0 - 3.0 * t - 4.0 * t * t + t * t * t;
        let slope = |t: f64| -3.0 - 8.0 * t + 3.0 * t * t;
        let time = crossing([value(0.0), slope(0.0)], [value(2.0), slope(2.0)], 2.0).unwrap();
        assert!(value(time).abs() < 1e-14);
        assert_eq!(crossing([1.0, -1.0], [0.5, 0.0], 1.0), None);
    }
}
