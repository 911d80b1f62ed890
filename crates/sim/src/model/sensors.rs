//! Readings of sensors on a body. Over numbers that carry derivatives, so do they.

use nalgebra::{Point3, Vector3, Vector6};
use prehend_autodiff::Scalar;

use super::Model;
use crate::body_state::Rows;
use crate::error::Result;
use crate::handle::BodyId;
use crate::spatial::{angular, linear};
use crate::state::State;

impl<S: Scalar> Model<S> {
    /// Wrench of contacts and bushings on a body: force \[N\] and torque \[N m\] about its center of mass, of a link about the origin of its frame; world
    /// frame.
    ///
    /// # Errors
    /// If there is no such body, or it is no state of this model.
    pub fn contact_wrench(&self, body: BodyId, state: &State<S>) -> Result<Vector6<S>> {
        let external = self.body(body)?.external_wrench;
        let state = self.sensed(state)?;
        // Leaks of the first step are no forces.
        let model = self.with_touching(state.rows(), 0.0);
        Ok(model.contact_wrenches(state.rows(), 1)[body] - external)
    }

    /// Reading of an accelerometer at `point` of a body, given in its body frame \[m\]: acceleration less that of free fall, along the axes of the
    /// body \[m/s²\].
    ///
    /// # Errors
    /// If there is no such body or no force moves it, or it is no state of this model.
    pub fn accelerometer(
        &self,
        body: BodyId,
        point: &Point3<f64>,
        state: &State<S>,
    ) -> Result<Vector3<S>> {
        let rigid = self.body(body)?.rigid();
        let state = self.sensed(state)?;
        let states = state.rows();
        let wrenches = self.wrenches_of(states, 1);
        let state = &states[body];
        let (acceleration, turning, arm) = match rigid {
            Some(rigid) => {
                let (force, torque) =
                    (wrenches[body].fixed_rows::<3>(0), wrenches[body].fixed_rows::<3>(3));
                let momentum = rigid.momentum(&state.pose.rotation, &state.angular);
                let left = torque - state.angular.cross(&momentum);
                let turning = rigid.inverse_world_inertia(&state.pose.rotation) * left;
                let arm = point.coords.map(S::constant) - rigid.com().coords;
                (force * (S::one() / rigid.mass()), turning, arm)
            }
            None => {
                let (articulation, link) = self.link_of(body)?;
                let (acceleration, turning) =
                    self.link_acceleration(articulation, link, states, &wrenches);
                (acceleration, turning, point.coords.map(S::constant))
            }
        };
        let arm = state.pose.rotation * arm;
        let spin = &state.angular;
        let felt = acceleration + turning.cross(&arm) + spin.cross(&spin.cross(&arm));
        Ok(state.pose.rotation.inverse() * felt)
    }

    /// Acceleration of a link's origin, less that of free fall, and its angular acceleration, world frame.
    fn link_acceleration(
        &self,
        articulation: usize,
        link: usize,
        states: &Rows<S>,
        wrenches: &[Vector6<S>],
    ) -> (Vector3<S>, Vector3<S>) {
        let (own, places) = (&self.articulations[articulation], self.joint_range(articulation));
        let [q, v] = own.coordinates(&states[places.clone()]);
        let rates = wrenches[places].iter().zip(own.tree.links());
        let accelerations: Vec<S> =
            rates.flat_map(|(rate, link)| link.joint.accelerations(rate)).collect();
        let at = own.tree.kinematics(&q, &v).under(self.gravity);
        let of_link = at.acceleration(link, &accelerations);
        (linear(&of_link), angular(&of_link))
    }

    /// A state with links where their joints put them.
    pub(crate) fn sensed(&self, state: &State<S>) -> Result<State<S>> {
        let mut state = self.with_deflections(state.clone());
        self.check_count(&state)?;
        self.forward_kinematics(state.rows_mut());
        Ok(state)
    }
}
