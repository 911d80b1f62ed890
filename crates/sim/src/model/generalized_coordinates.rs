//! Generalized coordinates of a state.

use std::ops::Range;

use prehend_autodiff::Scalar;

use crate::articulated::{Joint, JointState};
#[cfg(doc)]
use crate::body_state::BodyState;
use crate::body_state::STATE;
use crate::error::{Result, SimulationError};
use crate::handle::BodyId;
use crate::model::Model;
use crate::model::body::Motion;
use crate::state::State;

/// Places of a state's independent numbers among all of its [rows](State::rows), 13 a row as [`BodyState::coordinates`] has them; the others follow.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StatePlaces {
    /// [Positions](Model::generalized_coordinates).
    pub positions: Vec<usize>,
    /// [Velocities](Model::generalized_coordinates).
    pub velocities: Vec<usize>,
    /// Deflections of contacts with bristles, six each.
    pub deflections: Vec<usize>,
    /// Poses and velocities of bodies that no force moves, 13 each: fixed ones, then links with a [placed joint](Joint::Placed).
    pub fixed: Vec<usize>,
}

impl<S: Scalar> Model<S> {
    /// Number N of degrees of freedom: six for each free body and as many as each joint has velocities.
    pub fn degrees_of_freedom(&self) -> usize {
        self.coordinates().map(|(.., joint)| joint.nv()).sum()
    }

    /// Row, body and joint of free bodies, which float, then of links.
    fn coordinates(&self) -> impl Iterator<Item = (usize, BodyId, &Joint)> {
        let free = self.free_bodies().into_iter();
        let free = free.map(|body| (body.index(), body, &Joint::Floating));
        let moved = |(.., joint): &(usize, BodyId, &Joint)| !matches!(joint, Joint::Placed);
        free.chain(self.joint_rows().filter(moved))
    }

    /// Row, link and joint of all links.
    fn joint_rows(&self) -> impl Iterator<Item = (usize, BodyId, &Joint)> {
        let links = self.articulations.iter().flat_map(|own| own.bodies());
        let joints = self.joint_places().zip(links).zip(self.joints());
        joints.map(|((row, link), joint)| (row, *link, joint))
    }

    /// Row and link of placed joints.
    pub(crate) fn placed_links(&self) -> impl Iterator<Item = (usize, BodyId)> {
        let placed = |(.., joint): &(usize, BodyId, &Joint)| matches!(joint, Joint::Placed);
        self.joint_rows().filter(placed).map(|(row, link, _)| (row, link))
    }

    /// Row and body of those that no force moves, and whose place the state tells: fixed bodies, then links with placed joints.
    fn still_bodies(&self) -> impl Iterator<Item = (usize, BodyId)> {
        let fixed = |id: &BodyId| matches!(self.bodies[*id].motion, Motion::Fixed);
        self.body_ids().filter(fixed).map(|id| (id.index(), id)).chain(self.placed_links())
    }

    /// Places of the independent numbers of a state.
    pub fn state_places(&self) -> StatePlaces {
        let numbers = |row: usize| STATE * row..STATE * (row + 1);
        let mut places = StatePlaces::default();
        for (row, _, joint) in self.coordinates() {
            let [q, v] = joint.places();
            places.positions.extend(numbers(row).skip(q.start).take(q.len()));
            places.velocities.extend(numbers(row).skip(v.start).take(v.len()));
        }
        let bristles = self.joint_places().end..self.state_count();
        places.deflections = bristles.flat_map(|row| numbers(row).skip(7)).collect();
        places.fixed = self.still_bodies().flat_map(|(row, _)| numbers(row)).collect();
        places
    }

    /// Ranges of a free body's coordinates, or of those of a link's joint, among all positions and velocities: MuJoCo's `jnt_qposadr` and
    /// `jnt_dofadr`. None of a body that has none.
    pub fn coordinate_ranges(&self, body: BodyId) -> Option<[Range<usize>; 2]> {
        let (mut q, mut v) = (0, 0);
        for (_, own, joint) in self.coordinates() {
            if own == body {
                return Some([q..q + joint.nq(), v..v + joint.nv()]);
            }
            (q, v) = (q + joint.nq(), v + joint.nv());
        }
        None
    }

    /// Place of a body among those that no force moves, in the order of [`StatePlaces::fixed`].
    pub fn fixed_row(&self, body: BodyId) -> Option<usize> {
        self.still_bodies().position(|(_, own)| own == body)
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
