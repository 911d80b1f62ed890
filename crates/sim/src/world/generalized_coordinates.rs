//! Generalized coordinates of a state.

use prehend_autodiff::Scalar;

use crate::articulated::{Joint, JointState};
use crate::error::{Result, SimulationError};
use crate::state::State;
use crate::world::World;

impl<S: Scalar> World<S> {
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
    /// If it is no state of this world.
    pub fn generalized_coordinates(&self, state: &State<S>) -> JointState<S> {
        let (mut position, mut velocity) = (Vec::new(), Vec::new());
        for body in self.free_bodies() {
            Joint::Floating.read(&state[body], &mut position, &mut velocity);
        }
        for (place, joint) in self.joint_places().zip(self.joints()) {
            joint.read(&state.rows()[place], &mut position, &mut velocity);
        }
        JointState { position, velocity }
    }

    /// Sets [generalized coordinates](World::generalized_coordinates), and moves links to where their joints are then. Quaternions are normalized.
    ///
    /// # Errors
    /// If the numbers are too few or too many, or a quaternion is zero. The state stays as it was.
    ///
    /// # Panics
    /// If it is no state of this world.
    pub fn set_generalized_coordinates(
        &self,
        state: &mut State<S>,
        position: &[S],
        velocity: &[S],
    ) -> Result<()> {
        let free = self.free_bodies();
        let [nq, nv] = self.joints().fold([7 * free.len(), 6 * free.len()], |[nq, nv], joint| {
            [nq + joint.nq(), nv + joint.nv()]
        });
        let (given, expected) = ([position.len(), velocity.len()], [nq, nv]);
        if given != expected {
            return Err(SimulationError::GeneralizedCoordinates { given, expected });
        }
        let mut changed = state.clone();
        let (mut position, mut velocity) = (position, velocity);
        let mut next = |nq, nv| {
            let (q, v);
            (q, position) = position.split_at(nq);
            (v, velocity) = velocity.split_at(nv);
            (q, v)
        };
        for body in free {
            let (q, v) = next(7, 6);
            self.check_rotation(body, &Joint::Floating, q)?;
            changed[body] = Joint::Floating.write(q, v);
        }
        let links = self.articulations.iter().flat_map(|own| own.bodies());
        for (link, joint) in links.zip(self.joints()) {
            let (q, v) = next(joint.nq(), joint.nv());
            self.write_joint(changed.rows_mut(), *link, q, v)?;
        }
        self.forward_kinematics(changed.rows_mut());
        *state = changed;
        Ok(())
    }
}
