//! When in a step a contact begins or ends, where forces have kinks.

use prehend_geometry::FieldSample;

use crate::body_state::{BodyState, Rows};
use crate::contact::contact_query::ContactQuery;
use crate::contact::gap_smoothing::GapSmoothing;
use crate::model::Model;
use crate::model::contact_pair::ContactPair;
use crate::surface::SurfacePoint;

/// Time into a step of `dt` \[s\] from `start` to `end` at which the first sample enters or leaves the reach of its
/// contact's law without smoothing, but not before `earliest` \[s\].
pub(super) fn first(
    model: &Model,
    start: &Rows,
    end: &Rows,
    dt: f64,
    earliest: f64,
) -> Option<f64> {
    let hard = |pair: &&ContactPair| !matches!(pair.smoothing, GapSmoothing::Softplus { .. });
    let times = model.contacts.iter().filter(hard);
    let times = times.filter_map(|pair| first_of(model, pair, [start, end], dt, earliest));
    times.min_by(f64::total_cmp)
}

fn first_of(
    model: &Model,
    pair: &ContactPair,
    ends: [&Rows; 2],
    dt: f64,
    earliest: f64,
) -> Option<f64> {
    let reach = pair.law().cutoff();
    let passage = SamplesOverStep::new(model, pair, ends, dt)?;
    let times = passage.each_near(reach).filter_map(|(point, _)| {
        let [from, to] = passage.gaps(point, reach);
        crossing(from?, to?, dt).filter(|time| *time > earliest)
    });
    times.min_by(f64::total_cmp)
}

/// True if a sample of `pair` is in reach of its law by more than `depth` \[m\] within a step of `dt` \[s\], but at neither end of it.
pub(super) fn dips(
    model: &Model,
    pair: &ContactPair,
    ends: [&Rows; 2],
    dt: f64,
    depth: f64,
) -> bool {
    let reach = pair.law().cutoff() + pair.smoothing.force_band();
    let Some(passage) = SamplesOverStep::new(model, pair, ends, dt) else { return false };
    passage.each_near(reach).any(|(point, distance)| {
        // Most of those that are asked about touch.
        if distance - point.radius <= reach {
            return false;
        }
        let [Some(from), Some(to)] = passage.gaps(point, reach) else { return false };
        from[0] > 0.0 && to[0] > 0.0 && least(from, to, dt) < -depth
    })
}

/// Samples beside a field at both ends of a step.
struct SamplesOverStep<'a> {
    /// At the start.
    query: ContactQuery<'a>,
    ends: [BodyState; 2],
    /// Largest distance that a sample moves \[m\].
    travel: f64,
}

impl<'a> SamplesOverStep<'a> {
    /// Samples of `pair` beside its field at both `ends` of a step of `dt` \[s\].
    fn new(model: &'a Model, pair: &'a ContactPair, ends: [&Rows; 2], dt: f64) -> Option<Self> {
        let ends = ends.map(|states| model.relative_value(pair, states));
        let query = model.contact_query(pair, ends[0])?;
        let radius = query.surface.radius_about(&query.com);
        let travel = dt * ends[0].speed_within(radius).max(ends[1].speed_within(radius));
        Some(Self { query, ends, travel })
    }

    /// The samples that may come within `reach` \[m\], each with its center's distance at the start \[m\].
    fn each_near(&self, reach: f64) -> impl Iterator<Item = (&SurfacePoint, f64)> {
        self.query.each_near(reach, self.travel)
    }

    /// The gaps of a sample beyond `reach` \[m\] and their rates \[m/s\], at both ends.
    fn gaps(&self, point: &SurfacePoint, reach: f64) -> [Option<[f64; 2]>; 2] {
        let ContactQuery { com, field, .. } = self.query;
        self.ends.map(|state| {
            let arm = state.pose.rotation * (point.position - com);
            let place = (state.pose.translation.vector + arm).into();
            let FieldSample { distance, gradient, .. } = field.sample(&place, f64::INFINITY)?;
            let rate = gradient.dot(&(state.linear + state.angular.cross(&arm)));
            Some([distance - point.radius - reach, rate])
        })
    }
}

/// The cubic over 0 to 1 with a value and a slope at both ends, where a step is `dt` \[s\] long.
fn cubic([a, rate_a]: [f64; 2], [b, rate_b]: [f64; 2], dt: f64) -> impl Fn(f64) -> f64 {
    let (da, db) = (rate_a * dt, rate_b * dt);
    move |t| {
        let s = 1.0 - t;
        s * s * ((1.0 + 2.0 * t) * a + t * da) + t * t * ((1.0 + 2.0 * s) * b - s * db)
    }
}

/// The least value of the cubic with a value and a slope at 0 and at `dt`.
fn least(from: [f64; 2], to: [f64; 2], dt: f64) -> f64 {
    let value = cubic(from, to, dt);
    let (da, db) = (from[1] * dt, to[1] * dt);
    // Slope: da + 2 c t + 3 d t².
    let d = 2.0 * (from[0] - to[0]) + da + db;
    let c = 3.0 * (to[0] - from[0]) - 2.0 * da - db;
    let root = (c * c - 3.0 * d * da).max(0.0).sqrt();
    // The root at which the slope grows, in the form without cancellation.
    let t = if c > 0.0 { -da / (c + root) } else { (root - c) / (3.0 * d) };
    let inside = if t > 0.0 && t < 1.0 { value(t) } else { f64::INFINITY };
    inside.min(from[0]).min(to[0])
}

/// Zero of the cubic with a value and a slope at 0 and at `dt`, if the values differ in their signs.
fn crossing(from: [f64; 2], to: [f64; 2], dt: f64) -> Option<f64> {
    let a = from[0];
    if (a > 0.0) == (to[0] > 0.0) {
        return None;
    }
    let value = cubic(from, to, dt);
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
    use std::sync::Arc;

    use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
    use prehend_geometry::SplitMix64;

    use super::*;
    use crate::fields::HalfSpace;
    use crate::{Body, ContactBodies, Coulomb, KelvinVoigt, Law, RigidBody, Surface};

    /// A foot that comes down and goes up again by the cubic whose least value is a quarter of the way of its speed below both ends.
    #[test]
    fn only_what_gets_deep_enough_dips() {
        let (dt, speed, depth) = (0.01, 0.4, 1e-4);
        let rigid = RigidBody::new(1.0, Matrix3::identity(), Point3::origin()).unwrap();
        let mut model = Model::new(Vector3::zeros());
        let field = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
        let surface = Surface::uniform(&[Point3::origin()], 1e-4).unwrap();
        let samples = model.add(Body::dynamic("foot", rigid).with_surface(surface));
        let spring = KelvinVoigt { stiffness: 1e7, damping: 1e5 };
        let law = Law::new(spring, Coulomb { friction: 0.5, slip_scale: 1e-2 }).unwrap();
        let bodies = ContactBodies { samples, field };
        model.add_contact(bodies, Arc::new(law), GapSmoothing::Hard).unwrap();
        for (least, expected) in [(5e-5, false), (-5e-5, false), (-2e-4, true)] {
            let height = 0.25 * speed * dt + least;
            let ends = [-speed, speed].map(|speed| {
                let mut foot = BodyState::at_rest(Isometry3::translation(0.0, 0.0, height));
                foot.linear.z = speed;
                [BodyState::at_rest(Isometry3::identity()), foot]
            });
            let [start, end] = &ends;
            let found = dips(&model, &model.contacts[0], [start, end], dt, depth);
            assert_eq!(found, expected, "{least}");
        }
    }

    #[test]
    fn a_cubic_crosses_where_it_does() {
        // 2 − 3t − 4t² + t³ from 0 to 2.
        let value = |t: f64| 2.0 - 3.0 * t - 4.0 * t * t + t * t * t;
        let slope = |t: f64| -3.0 - 8.0 * t + 3.0 * t * t;
        let time = crossing([value(0.0), slope(0.0)], [value(2.0), slope(2.0)], 2.0).unwrap();
        assert!(value(time).abs() < 1e-14);
        assert_eq!(crossing([1.0, -1.0], [0.5, 0.0], 1.0), None);
    }

    #[test]
    fn the_least_of_a_cubic_is_that_of_many_places() {
        let mut random = SplitMix64::new(3);
        for i in 0..1000 {
            let mut number = || 2.0 * random.uniform() - 1.0;
            let (mut from, to, dt) = ([number(), number()], [number(), number()], 0.7);
            if i % 3 == 0 {
                // A parabola.
                from[1] = 2.0 * (to[0] - from[0]) / dt - to[1];
            }
            let value = cubic(from, to, dt);
            let all = (0..=10_000).map(|i| value(f64::from(i) * 1e-4));
            let expected = all.fold(f64::INFINITY, f64::min);
            assert!((least(from, to, dt) - expected).abs() < 1e-7, "{from:?} {to:?}");
        }
    }
}
