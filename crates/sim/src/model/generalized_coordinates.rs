//! Generalized coordinates of a state.

use prehend_autodiff::Scalar;

use crate::articulated::{Joint, JointState};
use crate::error::{Result, SimulationError};
use crate::handle::BodyId;
use crate::model::Model;
use crate::state::State;

impl<S: Scalar> Model<S> {
    /// Number N of degrees of freedom: six for each free body and as many as each joint has velocities.
    pub fn degrees_of_freedom(&self) -> usize {
        self.coordinates().map(|(.., joint)| joint.nv()).sum()
    }

    /// Row, body and joint of free bodies, which float, then of links.
    fn coordinates(&self) -> impl Iterator<Item = (usize, BodyId, &Joint)> {
        let free = self.free_bodies().into_iter();
        let free = free.map(|body| (body.index(), body, &Joint::Floating));
        let links = self.articulations.iter().flat_map(|own| own.bodies());
        let joints = self.joint_places().zip(links).zip(self.joints());
        free.chain(joints.map(|((row, link), joint)| (row, *link, joint)))
    }

    /// Generalized positions and velocities, `qpos` and `qvel` of MuJoCo: of free bodies, then of joints, in the order in which they were added.
    ///
    /// | | position | velocity |
    /// |---|---|---|
    /// | free body | center of mass \[m\], quaternion (i, j, k, w) | that of the center of mass \[m/s\], angular velocity \[rad/s\]; world's axes |
    /// | joint of a link | as [`Joint`] has them | as [`Joint`] has them |
    ///
    /// Velocities are ordered as in a [`LinearizedStep`](crate::LinearizedStep).
    ///
    /// # Panics
    /// If it is no state of this model.
    pub fn generalized_coordinates(&self, state: &State<S>) -> JointState<S> {
        let (mut position, mut velocity) = (Vec::new(), Vec::new());
        for (row, _, joint) in self.coordinates() {
            joint.read(&state.rows()[row], &mut position, &mut velocity);
        }
        JointState { position, velocity }
    }

    /// Sets [generalized coordinates](Model::generalized_coordinates), and moves links to where their joints are then. Quaternions are normalized.
    ///
    /// # Errors
    /// If the numbers are too few or too many, or a quaternion is zero. The state stays as it was.
    ///
    /// # Panics
    /// If it is no state of this model.
    pub fn set_generalized_coordinates(
        &self,
        state: &mut State<S>,
        position: &[S],
        velocity: &[S],
    ) -> Result<()> {
        let nq = self.coordinates().map(|(.., joint)| joint.nq()).sum();
        let given = [position.len(), velocity.len()];
        let expected = [nq, self.degrees_of_freedom()];
        if given != expected {
            return Err(SimulationError::GeneralizedCoordinates { given, expected });
        }
        let mut changed = state.clone();
        let (mut position, mut velocity) = (position, velocity);
        for (row, body, joint) in self.coordinates() {
            let (q, v);
            (q, position) = position.split_at(joint.nq());
            (v, velocity) = velocity.split_at(joint.nv());
            self.check_rotation(body, joint, q)?;
            changed.rows_mut()[row] = joint.write(q, v);
        }
        self.forward_kinematics(changed.rows_mut());
        *state = changed;
        Ok(())
    }
}
