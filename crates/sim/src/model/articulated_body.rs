//! Links that hang together by joints, as bodies of a model.
//!
//! The states of their joints follow those of the bodies, one for each link: coordinates in the pose, velocities in the velocities. Those of
//! the links follow from them.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Isometry3, Vector6};
use prehend_autodiff::Scalar;
use prehend_autodiff::rigid::turned;

use super::Model;
use super::body::{Body, Motion};
use super::joint_force::JointAxis;
use crate::articulated::adjoint::link_states;
use crate::articulated::joint_state::JointState;
use crate::articulated::{Articulation, Joint, Link};
use crate::body_state::{BodyState, Rows};
use crate::error::{BuildError, Result, SimulationError};
use crate::handle::BodyId;
use crate::state::State;

/// A tree of links, each a body of its model.
#[derive(Clone, Debug)]
pub struct ArticulatedBody<S: Scalar = f64> {
    /// Links and joints. They fall with the gravity of the model.
    pub tree: Articulation<S>,
    bodies: Arc<[BodyId]>,
}

impl<S: Scalar> ArticulatedBody<S> {
    /// The bodies that its links are, in their order.
    pub fn bodies(&self) -> &[BodyId] {
        &self.bodies
    }

    pub(super) fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> ArticulatedBody<T> {
        ArticulatedBody { tree: self.tree.map(f), bodies: Arc::clone(&self.bodies) }
    }

    /// Links as other bodies.
    pub(crate) fn with_bodies(&self, body: impl Fn(BodyId) -> BodyId) -> Self {
        let bodies = self.bodies.iter().map(|id| body(*id)).collect();
        Self { tree: self.tree.clone(), bodies }
    }

    /// Coordinates and velocities of all joints with these states.
    pub(crate) fn coordinates<T: Scalar>(&self, joints: &Rows<T>) -> [Vec<T>; 2] {
        let [mut q, mut v] = [self.tree.nq(), self.tree.nv()].map(Vec::with_capacity);
        for (link, state) in self.tree.links().iter().zip(joints) {
            link.joint.read(state, &mut q, &mut v);
        }
        [q, v]
    }
}

impl Model {
    /// Adds links, each after its parent, as bodies named after them, and returns which, in the same order. Give them samples and fields as
    /// other bodies.
    ///
    /// The joints are free to move: start from [`Model::neutral_state`] and set them by [`Model::set_joint`]. The state of a link, that of its
    /// frame, follows from its joints; what is written there is overwritten.
    ///
    /// ```
    /// use nalgebra::{Isometry3, Point3, Vector3};
    /// use prehend_sim::articulated::{Joint, Link};
    /// use prehend_sim::{RigidBody, Model};
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// // Two rods of 1 m and 1 kg that hang on each other, and the first on a hinge 2 m above the ground.
    /// let rod = RigidBody::cuboid(1.0, [0.01, 0.01, 0.5])?.moved(&Isometry3::translation(0.0, 0.0, -0.5));
    /// let hinge = Joint::Revolute(Vector3::y_axis());
    /// let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    /// let links = model.add_articulation(vec![
    ///     Link::new("upper", hinge.clone(), &rod).at(Isometry3::translation(0.0, 0.0, 2.0)),
    ///     Link::new("lower", hinge, &rod).on(0, Isometry3::translation(0.0, 0.0, -1.0)),
    /// ])?;
    /// let mut start = model.neutral_state();
    /// model.set_joint(&mut start, links[0], &[0.5], &[0.0])?;
    /// let end = model.simulate(&start, 1.0)?;
    /// let [angle, velocity] = model.joint_motion(&end, links[1])?;
    /// let tip = end[links[1]].pose * Point3::new(0.0, 0.0, -1.0);
    /// # assert!(angle.abs() > 0.1 && velocity.is_finite() && tip.z > -1e-9);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// If the links are no tree, a joint moves no mass, or a link's inertia has a negative principal moment.
    pub fn add_articulation(&mut self, links: Vec<Link>) -> Result<Vec<BodyId>, BuildError> {
        let tree = Articulation::new(links, self.gravity)?;
        let links = tree.links().iter();
        let bodies: Vec<BodyId> =
            links.map(|link| Body::link(&link.name)).map(|b| self.add(b)).collect();
        self.articulations.push(ArticulatedBody { tree, bodies: bodies.as_slice().into() });
        Ok(bodies)
    }
}

impl<S: Scalar> Model<S> {
    /// State in which everything is at rest at time 0: frames of bodies at the origin, joints at their neutral coordinates, those that mimic
    /// others where these put them, contacts not deflected.
    pub fn neutral_state(&self) -> State<S> {
        let origin = Isometry3::identity();
        let mut rows = vec![BodyState::at_rest(origin); self.state_count()];
        for (body, row) in self.bodies.iter().zip(&mut rows) {
            if let Some(rigid) = body.rigid() {
                *row = rigid.at_rest(&origin);
            }
        }
        for (row, link) in self.placed_links() {
            rows[row].pose = self.link(link).map_or(origin, |link| link.t_parent_joint);
        }
        for own in &self.transmissions.couplings {
            // Both are joints of this model.
            drop(self.move_followers(&mut rows, own.leader.link));
        }
        self.forward_kinematics(&mut rows);
        State::from_rows(rows, self.bodies.len(), 0.0)
    }

    /// State at `time` \[s\] of [rows](State::rows): bodies, joints, contacts with bristles; the last may be missing.
    ///
    /// # Errors
    /// If they are too few or too many.
    pub fn state_of_rows(&self, rows: Vec<BodyState<S>>, time: f64) -> Result<State<S>> {
        let state = self.with_deflections(State::from_rows(rows, self.bodies.len(), time));
        self.check_count(&state).map(|()| state)
    }

    /// Puts the frame of a body that is no link, or one with a [placed joint](Joint::Placed), at `t_world_body`. Its velocities stay.
    ///
    /// # Errors
    /// If there is no such body, or it is another link.
    ///
    /// # Panics
    /// If it is no state of this model.
    pub fn set_pose(
        &self,
        state: &mut State<S>,
        body: BodyId,
        t_world_body: &Isometry3<S>,
    ) -> Result<(), BuildError> {
        let own = self.body(body)?;
        if let Motion::Link = own.motion {
            let placed = self.placed_links().find(|(_, link)| *link == body);
            let (row, _) = placed.ok_or_else(|| BuildError::IsALink { body: own.name.clone() })?;
            state.rows_mut()[row].pose = *t_world_body;
            self.forward_kinematics(state.rows_mut());
            return Ok(());
        }
        state[body].pose =
            own.rigid().map_or(*t_world_body, |rigid| rigid.at_rest(t_world_body).pose);
        Ok(())
    }

    /// Pose of a body's frame, `t_world_body`.
    ///
    /// # Panics
    /// If it is no state of this model, or no body of it.
    pub fn pose(&self, state: &State<S>, body: BodyId) -> Isometry3<S> {
        let pose = state[body].pose;
        self.bodies[body].rigid().map_or(pose, |rigid| rigid.body_pose(&pose))
    }

    /// Sets coordinates and velocities of the joint of a link, as [`Joint`] has them, and of those that mimic it in URDF, and
    /// moves all links to where they are then. Set a follower that is to be elsewhere after its leader.
    ///
    /// # Errors
    /// If it is no link, the numbers are too few or too many, a quaternion is zero, or it is no state of this model.
    pub fn set_joint(
        &self,
        state: &mut State<S>,
        link: BodyId,
        position: &[S],
        velocity: &[S],
    ) -> Result<()> {
        let rows = state.rows_mut();
        self.write_joint(rows, link, position, velocity)?;
        self.move_followers(rows, link)?;
        self.forward_kinematics(rows);
        Ok(())
    }

    /// Writes the joints that mimic that of `leader`, which mimics none.
    fn move_followers(&self, states: &mut Rows<S>, leader: BodyId) -> Result<()> {
        let couplings = self.transmissions.couplings.iter();
        for own in couplings.filter(|own| own.leader.link == leader) {
            let joint = self.joint_at(states, leader)?;
            let position = joint.position.iter().map(|q| q.times(own.slope).plus(own.offset));
            let velocity = joint.velocity.iter().map(|v| v.times(own.slope));
            let [position, velocity]: [Vec<S>; 2] = [position.collect(), velocity.collect()];
            self.write_joint(states, own.follower.link, &position, &velocity)?;
        }
        Ok(())
    }

    /// [`Model::set_joint`] at rows, without moving the links.
    pub(crate) fn write_joint(
        &self,
        states: &mut Rows<S>,
        link: BodyId,
        position: &[S],
        velocity: &[S],
    ) -> Result<()> {
        let (place, joint) = self.joint_place(states, link)?;
        if position.len() != joint.nq() || velocity.len() != joint.nv() {
            return Err(SimulationError::JointNumbers {
                link: self.bodies[link].name.clone(),
                given: [position.len(), velocity.len()],
                expected: [joint.nq(), joint.nv()],
            });
        }
        self.check_rotation(link, joint, position)?;
        states[place] = joint.write(position, velocity);
        Ok(())
    }

    /// An error unless the rotation among these coordinates, if there is one, has a direction.
    pub(crate) fn check_rotation(&self, body: BodyId, joint: &Joint, position: &[S]) -> Result<()> {
        if joint.turns() {
            let quaternion = &position[position.len() - 4..];
            let norm = quaternion.iter().map(|x| x.value().powi(2)).sum::<f64>().sqrt();
            if norm < f64::MIN_POSITIVE || !norm.is_finite() {
                let body = self.bodies[body].name.clone();
                return Err(SimulationError::Rotation { body, norm });
            }
        }
        Ok(())
    }

    /// Coordinates and velocities of the joint of a link, as [`Joint`] has them.
    ///
    /// # Errors
    /// If it is no link, or it is no state of this model.
    pub fn joint(&self, state: &State<S>, link: BodyId) -> Result<JointState<S>> {
        self.joint_at(state.rows(), link)
    }

    pub(crate) fn joint_at(&self, states: &Rows<S>, link: BodyId) -> Result<JointState<S>> {
        let (place, joint) = self.joint_place(states, link)?;
        let (mut position, mut velocity) = (Vec::new(), Vec::new());
        joint.read(&states[place], &mut position, &mut velocity);
        Ok(JointState { position, velocity })
    }

    /// Position and velocity along an axis of the joint of a link, the first if a link is given \[rad, rad/s or m, m/s\].
    ///
    /// # Errors
    /// If it is no link, its joint has no such axis, or it is no state of this model.
    pub fn joint_motion(&self, state: &State<S>, axis: impl Into<JointAxis>) -> Result<[S; 2]> {
        self.motion_along(state.rows(), axis.into())
    }

    pub(crate) fn motion_along(
        &self,
        states: &Rows<S>,
        JointAxis { link, index }: JointAxis,
    ) -> Result<[S; 2]> {
        self.check_axis(link, index)?;
        let (place, joint) = self.joint_place(states, link)?;
        Ok(joint.along(&states[place], index))
    }

    /// True if one body hangs on the other by a joint.
    pub(crate) fn share_joint(&self, a: BodyId, b: BodyId) -> bool {
        let (Ok((own, first)), Ok((other, second))) = (self.link_of(a), self.link_of(b)) else {
            return false;
        };
        let links = self.articulations[own].tree.links();
        own == other && (links[first].parent == Some(second) || links[second].parent == Some(first))
    }

    /// The articulation and the link in it that a body is.
    pub(crate) fn link_of(&self, body: BodyId) -> Result<(usize, usize), BuildError> {
        let name = &self.body(body)?.name;
        let found = self.articulations.iter().enumerate().find_map(|(index, own)| {
            Some((index, own.bodies.iter().position(|link| *link == body)?))
        });
        found.ok_or_else(|| BuildError::NotALink { body: name.clone() })
    }

    /// # Errors
    /// If there are joints, which `integrator` does not move.
    pub(crate) fn ensure_no_joints(&self, integrator: &'static str) -> Result<()> {
        match self.articulations.is_empty() {
            true => Ok(()),
            false => Err(SimulationError::Joints { integrator }),
        }
    }

    /// Moves on the joints among `states`, for `dt` \[s\] by semi-implicit Euler with the accelerations among `wrenches`.
    pub(crate) fn integrate_joints(&self, states: &mut Rows<S>, wrenches: &[Vector6<S>], dt: S) {
        for (place, joint) in self.joint_places().zip(self.joints()) {
            let (state, rate) = (&mut states[place], &wrenches[place]);
            state.linear += rate.fixed_rows::<3>(0) * dt;
            state.angular += rate.fixed_rows::<3>(3) * dt;
            let [linear, angular] = joint.rate_of_pose(state);
            state.pose.translation.vector += linear * dt;
            state.pose.rotation = turned(&state.pose.rotation, &(angular * dt));
        }
    }

    pub(crate) fn joint_place(&self, states: &Rows<S>, body: BodyId) -> Result<(usize, &Joint)> {
        let (articulation, link) = self.link_of(body)?;
        if states.len() < self.joint_places().end {
            return Err(self.wrong_count(states.len()));
        }
        let place = self.joint_range(articulation).start + link;
        Ok((place, &self.articulations[articulation].tree.links()[link].joint))
    }

    /// Range of the states of an articulation's joints.
    pub(crate) fn joint_range(&self, articulation: usize) -> Range<usize> {
        let before = self.articulations[..articulation].iter().map(|own| own.bodies.len());
        let first = self.bodies.len() + before.sum::<usize>();
        first..first + self.articulations[articulation].bodies.len()
    }

    /// The link that a body is.
    pub(crate) fn link(&self, body: BodyId) -> Result<&Link<S>, BuildError> {
        let (articulation, link) = self.link_of(body)?;
        Ok(&self.articulations[articulation].tree.links()[link])
    }

    /// Number of states of joints: one for each link.
    pub(crate) fn joint_count(&self) -> usize {
        self.articulations.iter().map(|own| own.bodies.len()).sum()
    }

    /// Range of the states of joints.
    pub(crate) fn joint_places(&self) -> Range<usize> {
        self.bodies.len()..self.bodies.len() + self.joint_count()
    }

    /// All joints, in the order of their states.
    pub(crate) fn joints(&self) -> impl Iterator<Item = &Joint> {
        self.articulations.iter().flat_map(|own| own.tree.links()).map(|link| &link.joint)
    }

    /// Each articulation with the states of its joints.
    pub(crate) fn articulated<'a, T: Scalar>(
        &'a self,
        states: &'a Rows<T>,
    ) -> impl Iterator<Item = (&'a ArticulatedBody<S>, &'a Rows<T>)> {
        let all = self.articulations.iter().enumerate();
        all.map(|(index, own)| (own, &states[self.joint_range(index)]))
    }

    /// Moves the links to where their joints put them.
    pub(crate) fn forward_kinematics(&self, states: &mut Rows<S>) {
        if self.articulations.is_empty() {
            return;
        }
        let mut placed = Vec::with_capacity(self.joint_count());
        for (own, joints) in self.articulated(states) {
            let [q, v] = own.coordinates(joints);
            placed.extend(own.bodies.iter().copied().zip(link_states(&own.tree, &q, &v)));
        }
        placed.into_iter().for_each(|(body, state)| states[body] = state);
    }

    /// The accelerations of all joints, each as the rate of its state's velocities, by `wrenches` on the bodies.
    pub(crate) fn joint_accelerations(
        &self,
        states: &Rows<S>,
        wrenches: &[Vector6<S>],
    ) -> Vec<Vector6<S>> {
        let mut all = Vec::with_capacity(self.joint_count());
        if self.articulations.is_empty() {
            return all;
        }
        let efforts = self.joint_efforts(states);
        for ((own, joints), efforts) in self.articulated(states).zip(&efforts) {
            let [coordinates, velocities] = &own.coordinates(joints);
            let wrenches: Vec<Vector6<S>> = own.bodies.iter().map(|body| wrenches[*body]).collect();
            let accelerations =
                self.accelerated(own, joints, [coordinates, velocities], efforts, &wrenches);
            for (index, link) in own.tree.links().iter().enumerate() {
                let [_, dofs] = own.tree.range(index);
                all.push(link.joint.rate_of_velocities(&accelerations.as_slice()[dofs]));
            }
        }
        all
    }
}
