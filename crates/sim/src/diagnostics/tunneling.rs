//! Samples that pass through a body within a step.

use prehend_autodiff::Scalar;

use crate::body_state::{BodyState, Rows};
use crate::model::Model;
use crate::model::body::Body;
use crate::model::broad_phase::BroadPhase;
use crate::model::contact_pair::{ContactBodies, ContactPair};
use crate::time::Step;

/// Part of the thickness of what they may touch by which samples move safely within a step.
const SAFE_TRAVEL: f64 = 0.25;

/// Watch over bodies that move by more than a small part of another one's thickness in a step.
pub(super) struct Tunneling {
    /// The states before the step; empty where no field is thin.
    before: Vec<BodyState>,
    /// Distance of each body's samples from its center of mass \[m\].
    radii: Vec<f64>,
    /// Smallest thickness of a field \[m\].
    thinnest: f64,
    first: Option<(ContactBodies, f64)>,
}

impl Tunneling {
    pub(super) fn new<S: Scalar>(model: &Model<S>, initial: &Rows<S>) -> Self {
        let fields = model.bodies.iter().filter_map(|body| body.field.as_ref());
        let thinnest = fields.map(|field| field.thickness()).fold(f64::INFINITY, f64::min);
        let watched = if thinnest.is_finite() { initial } else { &[] };
        let radius = |body: &Body<S>| {
            let com = body.com().map(S::value);
            body.surface.as_ref().map_or(0.0, |surface| surface.radius_about(&com))
        };
        Self {
            before: watched.iter().map(BodyState::value).collect(),
            radii: model.bodies.iter().map(radius).collect(),
            thinnest,
            first: None,
        }
    }

    /// After `step` has led to `states`.
    #[inline]
    pub(super) fn step<S: Scalar>(&mut self, model: &Model<S>, step: Step, states: &Rows<S>) {
        if self.before.is_empty() || self.first.is_some() {
            return;
        }
        let passed = |pair: &&ContactPair<S>| self.has_passed(model, pair, states);
        let mut found = model.contacts.iter().find(passed).map(|pair| pair.bodies);
        if found.is_none() && !model.contact_groups.is_empty() {
            found = self.in_groups(model, step, states);
        }
        self.first = found.map(|bodies| (bodies, step.start));
        self.before.iter_mut().zip(states).for_each(|(before, state)| *before = state.value());
    }

    /// Samples and field of the first passage, and when \[s\].
    pub(super) fn first(&self) -> Option<(ContactBodies, f64)> {
        self.first
    }

    /// A passage between bodies of groups.
    fn in_groups<S: Scalar>(
        &self,
        model: &Model<S>,
        step: Step,
        states: &Rows<S>,
    ) -> Option<ContactBodies> {
        let bodies = || self.before.iter().zip(states).zip(&self.radii);
        let fastest =
            bodies().map(|((before, after), radius)| travel(before, &after.value(), *radius));
        if fastest.fold(0.0, f64::max) <= SAFE_TRAVEL * self.thinnest {
            return None;
        }
        let moved: Vec<f64> =
            bodies().map(|((before, after), _)| travel(before, &after.value(), 0.0)).collect();
        let near = BroadPhase::new(model).find(&self.before, &moved, step.dt);
        let pairs = model.contacts_with(&near);
        let passed = |pair: &&ContactPair<S>| self.has_passed(model, pair, states);
        pairs.iter().find(passed).map(|pair| pair.bodies)
    }

    fn has_passed<S: Scalar>(
        &self,
        model: &Model<S>,
        pair: &ContactPair<S>,
        states: &Rows<S>,
    ) -> bool {
        let [before, after] =
            [model.relative_value(pair, &self.before), model.relative_value(pair, states)];
        let Some(query) = model.contact_query(pair, after) else { return false };
        let radius = query.surface.radius_about(&query.com);
        travel(&before, &after, radius) > SAFE_TRAVEL * query.field.thickness()
            && query.has_passed(before)
    }
}

/// Bound of the distance \[m\] that points of a body within `radius` \[m\] of its center of mass move.
fn travel(before: &BodyState, after: &BodyState, radius: f64) -> f64 {
    let moved = after.pose.translation.vector - before.pose.translation.vector;
    moved.norm() + radius * after.pose.rotation.angle_to(&before.pose.rotation)
}
