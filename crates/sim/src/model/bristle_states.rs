//! The states of contacts with bristles.
//!
//! They follow the states of the bodies and joints, in the order of the contacts. Each is a state at the origin, whose velocities are the
//! deflection of the contact's [`Bristles`]: a twist along the axes of the field, \[m\] and \[rad\].

use nalgebra::Vector6;
use prehend_autodiff::Scalar;

use super::Model;
use super::contact_pair::ContactPair;
use crate::body_state::{BodyState, Rows};
use crate::contact::bristles::Bristles;
use crate::error::{Result, SimulationError};
use crate::spatial::spatial;
use crate::state::State;

impl<S: Scalar> BodyState<S> {
    /// The deflection that this state is.
    pub(crate) fn deflection(&self) -> Vector6<S> {
        spatial(&self.linear, &self.angular)
    }

    /// The state of this deflection after a change.
    pub(crate) fn deflected(&self, change: &Vector6<S>) -> Self {
        let mut deflected = *self;
        deflected.linear += change.fixed_rows::<3>(0);
        deflected.angular += change.fixed_rows::<3>(3);
        deflected
    }
}

impl<S: Scalar> Model<S> {
    /// The contacts with bristles.
    pub(crate) fn bristle_contacts(&self) -> impl Iterator<Item = (&ContactPair<S>, Bristles)> {
        self.contacts.iter().filter_map(|pair| Some((pair, pair.law().bristles()?)))
    }

    /// True if the state at `index` is that of a free body, a joint or a contact with bristles.
    pub(crate) fn moves_by_forces(&self, index: usize) -> bool {
        self.bodies.get(index).is_none_or(|body| body.rigid().is_some())
    }

    /// Number of states.
    pub(crate) fn state_count(&self) -> usize {
        self.bodies.len() + self.joint_count() + self.bristle_contacts().count()
    }

    /// The error of as many `states`.
    pub(crate) fn wrong_count(&self, states: usize) -> SimulationError {
        let (bodies, joints) = (self.bodies.len(), self.joint_count());
        SimulationError::States {
            states,
            bodies,
            joints,
            bristles: self.bristle_contacts().count(),
        }
    }

    /// `state` with the deflections of contacts with bristles, zero if they are missing.
    pub(crate) fn with_deflections(&self, mut state: State<S>) -> State<S> {
        if state.rows().len() == self.bodies.len() + self.joint_count() {
            state.resize_rows(self.state_count());
        }
        state
    }

    /// An error unless a state has the bodies, joints and contacts with bristles of this model.
    pub(crate) fn check_count(&self, state: &State<S>) -> Result<()> {
        let rows = state.rows().len();
        match state.bodies().len() == self.bodies.len() && rows == self.state_count() {
            true => Ok(()),
            false => Err(self.wrong_count(rows)),
        }
    }

    /// Moves on the deflections among `states`, for `dt` \[s\] at the rates that follow the `wrenches` on the bodies.
    pub(crate) fn integrate_bristles(&self, states: &mut Rows<S>, wrenches: &[Vector6<S>], dt: S) {
        for (state, rate) in states.iter_mut().zip(wrenches).skip(self.joint_places().end) {
            *state = state.deflected(&(rate * dt));
        }
    }
}
