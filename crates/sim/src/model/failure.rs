//! Names body and contact for the errors of a simulation that cannot go on.

use prehend_autodiff::Scalar;

use super::Model;
use super::contact_pair::ContactPair;
use crate::body_state::Rows;
use crate::error::{Result, SimulationError};
use crate::handle::BodyId;

impl<S: Scalar> Model<S> {
    /// The error of `states` that led to `next`, not all finite, by `time` \[s\].
    pub(crate) fn not_finite(
        &self,
        states: &Rows<S>,
        next: &Rows<S>,
        time: f64,
    ) -> SimulationError {
        let failed = next.iter().position(|state| !state.is_finite()).unwrap_or_default();
        self.not_finite_at(failed, states, time)
    }

    /// The error of the state number `failed`, or of derivatives by it, that is not finite at `time` \[s\], beside `states`.
    pub(crate) fn not_finite_at(
        &self,
        failed: usize,
        states: &Rows<S>,
        time: f64,
    ) -> SimulationError {
        let (body, contact) = self.names(states, self.body_of_row(failed));
        SimulationError::NotFinite { body, contact, time }
    }

    /// The body that a row is of: the link of a joint, the one with the samples of a contact.
    pub(crate) fn body_of_row(&self, row: usize) -> BodyId {
        let mut links = self.articulations.iter().flat_map(|own| own.bodies()).copied();
        let joint = row.checked_sub(self.bodies.len()).and_then(|joint| links.nth(joint));
        let body = match row.checked_sub(self.joint_places().end) {
            Some(deflection) => {
                self.bristle_contacts().nth(deflection).map(|(pair, _)| pair.bodies.samples)
            }
            None => joint.or(Some(BodyId(row))),
        };
        body.unwrap_or(BodyId(0))
    }

    /// The error of `states` at `time` \[s\] that are too large to measure, or have derivatives that are.
    pub(crate) fn blown_up(&self, states: &Rows<S>, time: f64) -> SimulationError {
        let (body, contact) = self.most_accelerated(states);
        SimulationError::NotFinite { body, contact, time }
    }

    /// The error of steps from `states` at `time` \[s\] that even with `dt` \[s\] are too long.
    pub(crate) fn stalled(&self, states: &Rows<S>, time: f64, dt: f64) -> SimulationError {
        let (body, contact) = self.most_accelerated(states);
        SimulationError::Stalled { body, contact, time, dt }
    }

    /// The error of more than `max_substeps` parts from `states` at `time` \[s\].
    pub(crate) fn too_many_substeps(
        &self,
        states: &Rows<S>,
        time: f64,
        max_substeps: usize,
    ) -> SimulationError {
        let (body, contact) = self.most_accelerated(states);
        SimulationError::TooManySubsteps { body, contact, max_substeps, time }
    }

    /// The name of the free body that contacts accelerate most, and of what presses hardest on it.
    pub(crate) fn most_accelerated(&self, states: &Rows<S>) -> (String, Option<String>) {
        let acceleration = |body: &BodyId| {
            let mass = self.mass(*body);
            let pairs = self.contacts.iter().filter(|pair| pair.joins(*body));
            pairs.map(|pair| self.load(pair, states)).fold(0.0, f64::max) / mass
        };
        let free: Vec<BodyId> = self.moved_bodies().collect();
        let hardest =
            free.iter().max_by(|a, b| acceleration(a).total_cmp(&acceleration(b))).copied();
        self.names(states, hardest.unwrap_or(BodyId(0)))
    }

    /// The error of a contact of which one side has passed through the other at `time` \[s\].
    pub(crate) fn passed_through(&self, pair: &ContactPair<S>, time: f64) -> SimulationError {
        let [body, contact] = self.names_of(pair);
        SimulationError::PassedThrough { body, contact, time }
    }

    /// The names of the bodies with the samples and the field of `pair`.
    fn names_of(&self, pair: &ContactPair<S>) -> [String; 2] {
        [pair.bodies.samples, pair.bodies.field].map(|body| self.bodies[body].name.clone())
    }

    /// The name of a body, and that of the one that presses hardest on it of those that may touch it.
    pub(crate) fn names(&self, states: &Rows<S>, body: BodyId) -> (String, Option<String>) {
        let pairs = self.contacts.iter().filter(|pair| pair.joins(body));
        let loads = pairs.map(|pair| (pair, self.load(pair, states)));
        let hardest = loads.max_by(|(_, a), (_, b)| a.total_cmp(b));
        let other = hardest.map(|(pair, _)| {
            let ends = pair.bodies;
            if ends.samples == body { ends.field } else { ends.samples }
        });
        let name = |body: BodyId| self.bodies[body].name.clone();
        (name(body), other.map(name))
    }

    /// The force of a contact \[N\], infinite if it is no number.
    fn load(&self, pair: &ContactPair<S>, states: &Rows<S>) -> f64 {
        let force = self.force(pair, states);
        if force.is_nan() { f64::INFINITY } else { force }
    }

    /// Checks that derivatives through the beginning of every contact are right.
    pub(crate) fn check_onsets(&self) -> Result<()> {
        let jumps = |pair: &&ContactPair<S>| pair.force_jumps();
        match self.contact_materials().find(jumps) {
            Some(pair) => {
                let [body, contact] = self.names_of(pair);
                Err(SimulationError::ForceJumps { body, contact })
            }
            None => Ok(()),
        }
    }
}
