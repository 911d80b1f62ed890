//! A body as the field of another sees it.

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

use super::Model;
use super::contact_pair::ContactPair;
use crate::body_state::{BodyState, Rows};
use crate::handle::BodyId;

/// The body with the samples of a contact, in the body frame of the body with the field.
///
/// Samples are plain numbers from the center of mass. Where that carries derivatives, they are about the point of the body
/// which has its value for coordinates, as if the body were that: it does not move as the center of mass does.
pub(super) struct RelativeState<S: Scalar> {
    /// The state of that point.
    pub(super) state: BodyState<S>,
    /// From the center of mass to that point \[m\], a zero that carries derivatives; none if they are the same.
    pub(super) from_com: Option<Vector3<S>>,
}

impl<S: Scalar> Model<S> {
    /// State of the samples of `pair` relative to its field.
    #[inline]
    pub(super) fn relative_state(
        &self,
        pair: &ContactPair<S>,
        states: &Rows<S>,
    ) -> RelativeState<S> {
        let com = self.bodies[pair.bodies.field].com();
        let frame = states[pair.bodies.field].shifted(&-com.coords);
        let state = &states[pair.bodies.samples];
        let rigid = self.bodies[pair.bodies.samples].rigid();
        match rigid.and_then(|rigid| rigid.com_change()) {
            None => RelativeState { state: state.relative_to(&frame), from_com: None },
            Some(change) => {
                let state = state.shifted(&-change).relative_to(&frame);
                RelativeState { from_com: Some(-(state.pose.rotation * change)), state }
            }
        }
    }

    /// State, where the center of mass of body `id` carries derivatives, of the point that has its value for coordinates, and from
    /// it to that point \[m\].
    #[inline]
    pub(super) fn shifted(
        &self,
        id: BodyId,
        states: &Rows<S>,
    ) -> Option<(BodyState<S>, Vector3<S>)> {
        let change = self.bodies[id].rigid()?.com_change()?;
        let state = states[id].shifted(&-change);
        Some((state, -(state.pose.rotation * change)))
    }

    /// [`Model::relative_state`] without derivatives: nothing is recorded.
    pub(crate) fn relative_value<T: Scalar>(
        &self,
        pair: &ContactPair<S>,
        states: &Rows<T>,
    ) -> BodyState {
        let com = self.bodies[pair.bodies.field].com().coords.map(S::value);
        let mut frame = states[pair.bodies.field].value();
        if com != Vector3::zeros() {
            frame = frame.shifted(&-com);
        }
        states[pair.bodies.samples].value().relative_to(&frame)
    }
}
