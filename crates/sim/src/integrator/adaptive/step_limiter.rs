//! Distances that bodies may move before contacts could be passed over.

use std::cell::LazyCell;

use super::sensitivity::Tangent;
use super::touch_time;
use crate::body_state::{BodyState, Rows};
use crate::contact::contact_query::ContactQuery;
use crate::model::Model;
use crate::model::body::Motion;
use crate::model::contact_pair::ContactPair;

/// Part of a body's size by which its samples may always move.
const FREE_TRAVEL: f64 = 0.2;
/// Part of a body's size by which samples may move whatever their gaps do meanwhile.
const SHORT: f64 = 0.02;
/// Depth of a contact that is as good as none, as part of a body's size.
const GRAZING: f64 = 1e-6;
/// Part of the thickness of what they may touch by which they may move at most.
const FREE_THICKNESS: f64 = 0.25;
/// Part of that by which a trajectory may always deviate from uniform motion.
const FREE_DEVIATION: f64 = 0.05;
/// Interval at which trajectories are looked at \[s\].
const LOOK: f64 = 1e-3;
/// Looks ahead at most: no substep is longer.
const LOOKS: usize = 1000;

/// For each contact, what its samples may do, if a force moves one of the bodies.
pub(super) struct StepLimiter(Vec<Option<Limit>>);

/// Bounds on the motion of a contact's samples.
struct Limit {
    /// Distance of the farthest one's center from the center of mass \[m\].
    radius: f64,
    /// Size of the body \[m\].
    size: f64,
    /// Distance that they may always move \[m\].
    free: f64,
    /// Distance that they may move whatever their gaps do meanwhile \[m\].
    short: f64,
    /// True if what they touch has an end.
    thin: bool,
    /// True if one of the bodies is on a trajectory.
    driven: bool,
}

impl StepLimiter {
    pub(super) fn new(model: &Model) -> Self {
        let limit = |pair: &ContactPair| {
            let ends = [pair.bodies.samples, pair.bodies.field];
            let [body, other] = ends.map(|id| &model.bodies[id]);
            let [gyration, other_gyration] = ends.map(|id| model.gyration_radius(id));
            // Bodies that no force moves need not feel each other.
            (body.feels_forces() || other.feels_forces()).then_some(())?;
            let surface = body.surface.as_ref()?;
            let radius = surface.radius_about(&body.com());
            let own = radius.max(gyration);
            let thickness = other.field.as_ref()?.thickness() + 2.0 * surface.smallest();
            let size = if own > 0.0 { own } else { other_gyration };
            let thinnest = FREE_THICKNESS * thickness;
            let [free, short] = [FREE_TRAVEL, SHORT].map(|substep| (substep * size).min(thinnest));
            let radius = surface.spread_about(&body.com());
            let driven =
                [body, other].iter().any(|body| matches!(body.motion, Motion::Kinematic(_)));
            // The ends of a substep say nothing of a trajectory in between.
            let free = if driven { short } else { free };
            Some(Limit { radius, size, free, short, thin: thickness.is_finite(), driven })
        };
        Self(model.contacts.iter().map(limit).collect())
    }

    fn limits<'a>(
        &'a self,
        model: &'a Model,
    ) -> impl Iterator<Item = (&'a ContactPair, &'a Limit)> {
        let limited = model.contacts.iter().zip(&self.0);
        limited.filter_map(|(pair, limit)| Some((pair, limit.as_ref()?)))
    }

    /// The longest of the lengths `dt`, `dt`/2, … \[s\] from `time` on in which bodies that go on as they move, or as their
    /// trajectories say, could not pass over a contact: no sample moves by more than its clearance and a small part of its
    /// body's size. Of a trajectory that does not go on as it moves, a yet smaller substep counts, for all that it touches may be
    /// at rest.
    pub(super) fn longest(&self, model: &Model, states: &Rows, time: f64, mut dt: f64) -> f64 {
        // Both may fall, but not away from each other faster than one does.
        let fall = 0.5 * model.gravity.norm();
        for (pair, limit) in self.limits(model) {
            let state = model.relative_value(pair, states);
            let speed = state.speed_within(limit.radius);
            if limit.driven {
                dt = dt.min(LOOK * LOOKS as f64);
            }
            let deviations = limit.deviations(model, pair, states, time, dt);
            let passes_over = |dt: f64| {
                // The largest of those within the substep, which ascend.
                let looks = deviations.len().min((dt / LOOK) as usize);
                let deviation = deviations[..looks].last().copied().unwrap_or(0.0);
                let travel = dt * (speed + dt * fall) + deviation;
                (travel > limit.free || deviation > FREE_DEVIATION * limit.short)
                    && limit.is_near(model, pair, state, (travel - limit.free).max(0.0))
            };
            while passes_over(dt) {
                dt *= 0.5;
            }
        }
        dt
    }

    /// A contact whose samples have gone from `before` to `after` through the middle of what they touch.
    pub(super) fn crossed<'a>(
        &'a self,
        model: &'a Model,
        before: &Rows<Tangent>,
        after: &Rows<Tangent>,
    ) -> Option<&'a ContactPair> {
        let mut thin = self.limits(model).filter(|(_, limit)| limit.thin).map(|(pair, _)| pair);
        thin.find(|pair| {
            let [from, to] = [before, after].map(|states| model.relative_value(pair, states));
            model.contact_query(pair, to).is_some_and(|query| query.has_crossed(from))
        })
    }

    /// True if a step of `dt` \[s\] from `states` through `stages` may have passed over a contact.
    pub(super) fn passes_over(
        &self,
        model: &Model,
        states: &Rows,
        stages: &[Vec<BodyState<Tangent>>],
        dt: f64,
    ) -> bool {
        let end = LazyCell::new(|| -> Vec<BodyState> {
            stages.last().into_iter().flatten().map(BodyState::value).collect()
        });
        self.limits(model).any(|(pair, limit)| {
            let state = model.relative_value(pair, states);
            let speed = |state: BodyState| state.speed_within(limit.radius);
            let speeds = stages.iter().map(|stage| speed(model.relative_value(pair, stage)));
            let travel = dt * speeds.fold(speed(state), f64::max);
            travel > limit.short
                && (travel > limit.free && limit.is_near(model, pair, state, travel - limit.free)
                    || touch_time::dips(model, pair, [states, &end], dt, GRAZING * limit.size))
        })
    }
}

impl Limit {
    /// True if samples of `pair`, whose field sees their body in `state`, may touch if they move by `travel` \[m\].
    fn is_near(&self, model: &Model, pair: &ContactPair, state: BodyState, travel: f64) -> bool {
        let near =
            |query: ContactQuery<'_>| query.each_near(pair.law().cutoff(), travel).next().is_some();
        model.contact_query(pair, state).is_some_and(near)
    }

    /// Largest distance \[m\] of the samples of `pair` from where they would be if kinematic bodies went on as in `states`,
    /// or if they stayed there, whichever is less, as that of a belt is: at each look from `time` on for `dt` \[s\].
    fn deviations(
        &self,
        model: &Model,
        pair: &ContactPair,
        states: &Rows,
        time: f64,
        dt: f64,
    ) -> Vec<f64> {
        let looks = (dt / LOOK) as usize;
        if !self.driven || looks == 0 {
            return Vec::new();
        }
        let (mut there, mut uniform) = (states.to_vec(), states.to_vec());
        let mut farthest = 0.0_f64;
        let deviation = |look: usize| {
            let elapsed = LOOK * (look + 1) as f64;
            for body in [pair.bodies.samples, pair.bodies.field] {
                let Motion::Kinematic(trajectory) = &model.bodies[body].motion else { continue };
                there[body] = trajectory.state(time + elapsed);
                uniform[body] = states[body].drifted(elapsed);
            }
            let place = model.relative_value(pair, &there).pose;
            let from = [&uniform[..], states].map(|states| {
                let other = model.relative_value(pair, states).pose;
                let moved = place.translation.vector - other.translation.vector;
                moved.norm() + self.radius * place.rotation.angle_to(&other.rotation)
            });
            farthest = farthest.max(from[0].min(from[1]));
            farthest
        };
        (0..looks).map(deviation).collect()
    }
}
