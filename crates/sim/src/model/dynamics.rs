//! Mass matrix, accelerations, energy and momentum of a state.

use nalgebra::{DMatrix, DVector, Vector6};
use prehend_autodiff::Scalar;

use super::Model;
use crate::articulated::Energy;
use crate::body_state::BodyState;
use crate::error::Result;
use crate::handle::BodyId;
use crate::spatial::{angular, linear, spatial};
use crate::state::State;

impl<S: Scalar> Model<S> {
    /// Mass matrix M, N × N for N [degrees of freedom](Model::degrees_of_freedom), armature and rotors included: ½ v·M v is the kinetic energy of the
    /// velocities of [generalized coordinates](Model::generalized_coordinates).
    ///
    /// # Errors
    /// If it is no state of this model.
    pub fn mass_matrix(&self, state: &State<S>) -> Result<DMatrix<S>> {
        self.check_count(state)?;
        let count = self.degrees_of_freedom();
        let (mut matrix, mut first) = (DMatrix::zeros(count, count), 0);
        for (body, rigid) in self.rigid_bodies() {
            (0..3).for_each(|k| matrix[(first + k, first + k)] = rigid.mass());
            let inertia = rigid.world_inertia(&state[body].pose.rotation);
            matrix.fixed_view_mut::<3, 3>(first + 3, first + 3).copy_from(&inertia);
            first += 6;
        }
        for index in 0..self.articulations.len() {
            let block = self.mass_matrix_of(index, state.rows());
            matrix.view_mut((first, first), block.shape()).copy_from(&block);
            first += block.nrows();
        }
        Ok(matrix)
    }

    /// Rates of the velocities of [generalized coordinates](Model::generalized_coordinates) under gravity, contacts, bushings, joint forces and external
    /// wrenches: \[m/s²\] and \[rad/s²\], `qacc` of MuJoCo.
    ///
    /// # Errors
    /// If it is no state of this model.
    pub fn accelerations(&self, state: &State<S>) -> Result<DVector<S>> {
        let state = self.sensed(state)?;
        let rates = self.wrenches_of(state.rows(), 0);
        let mut all = Vec::with_capacity(self.degrees_of_freedom());
        for (body, rigid) in self.rigid_bodies() {
            let BodyState { pose, angular: spin, .. } = &state[body];
            let torque = angular(&rates[body.index()]);
            let momentum = rigid.momentum(&pose.rotation, spin);
            all.extend_from_slice(
                (self.gravity + linear(&rates[body.index()]) / rigid.mass()).as_slice(),
            );
            all.extend_from_slice(
                rigid.angular(&pose.rotation, &(torque - spin.cross(&momentum))).as_slice(),
            );
        }
        let joints = rates[self.joint_places()].iter().zip(self.joints());
        joints.for_each(|(rate, joint)| all.extend(joint.accelerations(rate)));
        Ok(DVector::from_vec(all))
    }

    /// Kinetic energy of all bodies, armature and rotors included, and potential energy in the gravity field, zero at the world's origin \[J\]. Springs
    /// and contacts are not among it.
    ///
    /// # Errors
    /// If it is no state of this model.
    pub fn energy(&self, state: &State<S>) -> Result<Energy<S>> {
        let mass = self.mass_matrix(state)?;
        let velocity = DVector::from_vec(self.generalized_coordinates(state).velocity);
        let kinetic = velocity.dot(&(mass * &velocity)).times(0.5);
        let mut potential = S::zero();
        for (body, rigid) in self.rigid_bodies() {
            potential -= rigid.mass() * self.gravity.dot(&state[body].pose.translation.vector);
        }
        for (own, joints) in self.articulated(state.rows()) {
            let [q, v] = own.coordinates(joints);
            potential += own.tree.kinematics(&q, &v).under(self.gravity).energy(&v).potential;
        }
        Ok(Energy { kinetic, potential })
    }

    /// Linear \[kg m/s\] and angular momentum about the world's origin \[kg m²/s\] of all free bodies and links, without armature and rotors.
    ///
    /// # Errors
    /// If it is no state of this model.
    pub fn momentum(&self, state: &State<S>) -> Result<Vector6<S>> {
        self.check_count(state)?;
        let mut sum = Vector6::zeros();
        for (body, rigid) in self.rigid_bodies() {
            let BodyState { pose, linear, angular } = &state[body];
            let along = linear * rigid.mass();
            let about =
                pose.translation.vector.cross(&along) + rigid.momentum(&pose.rotation, angular);
            sum += spatial(&along, &about);
        }
        for (own, joints) in self.articulated(state.rows()) {
            let [q, v] = own.coordinates(joints);
            sum += own.tree.kinematics(&q, &v).momentum();
        }
        Ok(sum)
    }

    /// Radius of gyration about its own center of mass of a body that forces move, 0 of others \[m\].
    pub(crate) fn gyration_radius(&self, body: BodyId) -> f64 {
        if let Some(rigid) = self.bodies[body].rigid() {
            return rigid.gyration_radius();
        }
        let Ok(link) = self.link(body) else { return 0.0 };
        let square = link.inertia.trace().value() / (2.0 * link.mass.value());
        if square.is_finite() { square.sqrt() } else { 0.0 }
    }

    /// Mass of a body that forces move, without end of others \[kg\].
    pub(crate) fn mass(&self, body: BodyId) -> f64 {
        if let Some(rigid) = self.bodies[body].rigid() {
            return rigid.mass().value();
        }
        self.link(body).map_or(f64::INFINITY, |link| link.mass.value())
    }
}
