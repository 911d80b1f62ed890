//! Links that hang together by joints, as bodies of a world.
//!
//! The states of their joints follow those of the bodies, one for each link: coordinates in the pose, velocities in the velocities. Those of
//! the links follow from them.

use std::sync::Arc;

use nalgebra::{Isometry3, Quaternion, Unit, Vector3, Vector6};
use prehend_autodiff::Scalar;
use prehend_autodiff::lie::so3_log;
use prehend_autodiff::rigid::turned;

use super::World;
use super::body::Body;
use super::body_id::BodyId;
use super::joint_force::{JointAxis, JointForce, JointForceId};
use crate::articulated::adjoint::{Acting, accelerations, link_states};
use crate::articulated::{Articulation, Joint};
use crate::error::SimulationError;
use crate::joint_law::dynamic::DynJointLaw;
use crate::robot::JointState;
use crate::state::State;

/// A tree of links, each a body of its world.
#[derive(Clone, Debug)]
pub struct ArticulatedBody<S: Scalar = f64> {
    /// Links and joints. They fall with the gravity of the world.
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

    /// The same links as other bodies.
    pub(crate) fn with_bodies(&self, body: impl Fn(BodyId) -> BodyId) -> Self {
        let bodies = self.bodies.iter().map(|id| body(*id)).collect();
        Self { tree: self.tree.clone(), bodies }
    }

    /// Coordinates and velocities of all joints with these states.
    pub(crate) fn coordinates<T: Scalar>(&self, joints: &[State<T>]) -> [Vec<T>; 2] {
        let [mut q, mut v] =
            [self.tree.coordinates(), self.tree.freedoms()].map(Vec::with_capacity);
        for (link, state) in self.tree.links().iter().zip(joints) {
            link.joint.read(state, &mut q, &mut v);
        }
        [q, v]
    }
}

impl World {
    /// Adds the links of `tree` as bodies, named after them, and returns which. Give them samples and fields as other bodies. The state of a
    /// link is that of its frame; its joint is set by [`World::set_joint`].
    pub fn add_articulation(&mut self, tree: Articulation) -> Vec<BodyId> {
        let links = tree.links().iter();
        let bodies: Vec<BodyId> =
            links.map(|link| Body::link(&link.name)).map(|b| self.add(b)).collect();
        self.articulations.push(ArticulatedBody { tree, bodies: bodies.as_slice().into() });
        bodies
    }

    /// Lets `law` act along the joint of a link, which has one axis or whose axis is given.
    ///
    /// # Errors
    /// If it is no link, or its joint has no such axis; a floating one has none.
    pub fn add_joint_force(
        &mut self,
        axis: impl Into<JointAxis>,
        law: impl crate::joint_law::JointLaw,
    ) -> Result<JointForceId, SimulationError> {
        self.add_coupled_force(&[(axis.into(), 1.0)], Arc::new(law))
    }

    /// Lets `law` act along a weighted sum of the joints of one articulation: its position is the sum of theirs times their factors, and each has
    /// its factor of the effort. So does a tendon, or a spring that couples joints.
    ///
    /// # Errors
    /// If there is none, one is no link or has no such axis, or they are not of one articulation.
    pub fn add_coupled_force(
        &mut self,
        axes: &[(JointAxis, f64)],
        law: Arc<dyn DynJointLaw>,
    ) -> Result<JointForceId, SimulationError> {
        let mut articulation = None;
        for (axis, _) in axes {
            let (own, link) = self.link_of(axis.link)?;
            let joint = &self.articulations[own].tree.links()[link].joint;
            let has = axis.index < joint.freedoms() && !matches!(joint, Joint::Floating);
            if !has || articulation.is_some_and(|other| other != own) {
                return Err(SimulationError::NoAxis { link: self.bodies[axis.link].name.clone() });
            }
            articulation = Some(own);
        }
        if axes.is_empty() {
            return Err(SimulationError::NoAxes);
        }
        self.joint_forces.push(JointForce::new(axes.to_vec(), law));
        Ok(JointForceId(self.joint_forces.len() - 1))
    }
}

impl<S: Scalar> World<S> {
    /// States in which everything is at rest: bodies with their center of mass at the origin, joints at their neutral coordinates.
    pub fn neutral_states(&self) -> Vec<State<S>> {
        let at_rest = State::at_rest(Isometry3::identity());
        let mut states = vec![at_rest; self.bodies.len() + self.joint_count()];
        self.place_links(&mut states);
        states
    }

    /// Sets coordinates and velocities of the joint of a link, as [`Joint`] has them, and moves all links to where they are then.
    ///
    /// # Errors
    /// If it is no link, the numbers are too few or too many, or the states are not those of this world.
    pub fn set_joint(
        &self,
        states: &mut [State<S>],
        link: BodyId,
        position: &[S],
        velocity: &[S],
    ) -> Result<(), SimulationError> {
        let (place, joint) = self.joint_place(states, link)?;
        if position.len() != joint.coordinates() || velocity.len() != joint.freedoms() {
            return Err(SimulationError::JointNumbers {
                link: self.bodies[link].name.clone(),
                given: [position.len(), velocity.len()],
                expected: [joint.coordinates(), joint.freedoms()],
            });
        }
        states[place] = joint.write(position, velocity);
        self.place_links(states);
        Ok(())
    }

    /// Coordinates and velocities of the joint of a link, as [`Joint`] has them.
    ///
    /// # Errors
    /// If it is no link, or the states are not those of this world.
    pub fn joint(
        &self,
        states: &[State<S>],
        link: BodyId,
    ) -> Result<JointState<S>, SimulationError> {
        let (place, joint) = self.joint_place(states, link)?;
        let (mut position, mut velocity) = (Vec::new(), Vec::new());
        joint.read(&states[place], &mut position, &mut velocity);
        Ok(JointState { position, velocity })
    }

    /// The force along joints called `id`, to be changed.
    ///
    /// # Panics
    /// If it is of another world.
    pub fn joint_force_mut(&mut self, id: JointForceId) -> &mut JointForce<S> {
        &mut self.joint_forces[id.0]
    }

    /// The articulation and the link in it that a body is.
    pub(crate) fn link_of(&self, body: BodyId) -> Result<(usize, usize), SimulationError> {
        let name = &self.body(body)?.name;
        let found = self.articulations.iter().enumerate().find_map(|(index, own)| {
            Some((index, own.bodies.iter().position(|link| *link == body)?))
        });
        found.ok_or_else(|| SimulationError::NotALink { body: name.clone() })
    }

    /// Radius of gyration about its own center of mass of a body that forces move, 0 of others \[m\].
    pub(crate) fn gyration_radius(&self, body: BodyId) -> f64 {
        if let Some(rigid) = self.bodies[body].rigid() {
            return rigid.gyration_radius();
        }
        let Ok((articulation, link)) = self.link_of(body) else { return 0.0 };
        let link = &self.articulations[articulation].tree.links()[link];
        let square = link.inertia.trace().value() / (2.0 * link.mass.value());
        if square.is_finite() { square.sqrt() } else { 0.0 }
    }

    /// Mass of a body that forces move, without end of others \[kg\].
    pub(crate) fn mass(&self, body: BodyId) -> f64 {
        if let Some(rigid) = self.bodies[body].rigid() {
            return rigid.mass().value();
        }
        let Ok((articulation, link)) = self.link_of(body) else { return f64::INFINITY };
        self.articulations[articulation].tree.links()[link].mass.value()
    }

    /// # Errors
    /// If there are joints, which `integrator` does not move.
    pub(crate) fn refuse_joints(&self, integrator: &'static str) -> Result<(), SimulationError> {
        match self.articulations.is_empty() {
            true => Ok(()),
            false => Err(SimulationError::Joints { integrator }),
        }
    }

    /// Moves on the joints among `states`, for `dt` \[s\] by semi-implicit Euler with the accelerations among `wrenches`.
    pub(crate) fn swing(&self, states: &mut [State<S>], wrenches: &[Vector6<S>], dt: S) {
        for (place, joint) in self.joint_places().zip(self.joints()) {
            let (state, rate) = (&mut states[place], &wrenches[place]);
            state.linear += rate.fixed_rows::<3>(0) * dt;
            state.angular += rate.fixed_rows::<3>(3) * dt;
            let [linear, angular] = joint.rate_of_pose(state);
            state.pose.translation.vector += linear * dt;
            state.pose.rotation = turned(&state.pose.rotation, &(angular * dt));
        }
    }

    fn joint_place(
        &self,
        states: &[State<S>],
        body: BodyId,
    ) -> Result<(usize, &Joint), SimulationError> {
        let (articulation, link) = self.link_of(body)?;
        let before = self.articulations[..articulation].iter().map(|a| a.bodies.len());
        let place = self.bodies.len() + before.sum::<usize>() + link;
        if states.len() < self.bodies.len() + self.joint_count() {
            return Err(self.wrong_count(states.len()));
        }
        Ok((place, &self.articulations[articulation].tree.links()[link].joint))
    }

    /// How many states joints have: one for each link.
    pub(crate) fn joint_count(&self) -> usize {
        self.articulations.iter().map(|own| own.bodies.len()).sum()
    }

    /// Where the states of joints are.
    pub(crate) fn joint_places(&self) -> std::ops::Range<usize> {
        self.bodies.len()..self.bodies.len() + self.joint_count()
    }

    /// All joints, in the order of their states.
    pub(crate) fn joints(&self) -> impl Iterator<Item = &Joint> {
        self.articulations.iter().flat_map(|own| own.tree.links()).map(|link| &link.joint)
    }

    /// Each articulation with the states of its joints.
    pub(crate) fn articulated<'a, T: Scalar>(
        &'a self,
        states: &'a [State<T>],
    ) -> impl Iterator<Item = (&'a ArticulatedBody<S>, &'a [State<T>])> {
        let mut next = self.bodies.len();
        self.articulations.iter().map(move |own| {
            let first = next;
            next += own.bodies.len();
            (own, &states[first..next])
        })
    }

    /// Moves the links to where their joints put them.
    pub(crate) fn place_links(&self, states: &mut [State<S>]) {
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
        states: &[State<S>],
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
            let (gravity, wrenches) = (self.gravity, &wrenches);
            let acting = Acting { gravity, coordinates, velocities, efforts, wrenches };
            let accelerations = accelerations(&own.tree, &acting);
            for (index, link) in own.tree.links().iter().enumerate() {
                let [_, freedoms] = own.tree.range(index);
                all.push(link.joint.rate_of_velocities(&accelerations.as_slice()[freedoms]));
            }
        }
        all
    }

    /// The efforts of all joint forces, one for each degree of freedom of each articulation \[N m or N\].
    pub(crate) fn joint_efforts(&self, states: &[State<S>]) -> Vec<Vec<S>> {
        let mut efforts: Vec<Vec<S>> =
            self.articulations.iter().map(|own| vec![S::zero(); own.tree.freedoms()]).collect();
        for force in &self.joint_forces {
            let Some((places, [position, velocity])) = self.along(force, states) else { continue };
            let effort = force.law().lifted(force.params(), position, velocity);
            for (articulation, freedom, factor) in places {
                efforts[articulation][freedom] += effort.times(factor);
            }
        }
        efforts
    }

    /// Which degrees of freedom a force acts along, with their factors; its position and velocity.
    pub(crate) fn along(
        &self,
        force: &JointForce<S>,
        states: &[State<S>],
    ) -> Option<(Vec<(usize, usize, f64)>, [S; 2])> {
        let (mut position, mut velocity) = (S::zero(), S::zero());
        let mut places = Vec::with_capacity(force.axes.len());
        for (JointAxis { link, index }, factor) in &force.axes {
            let (articulation, own) = self.link_of(*link).ok()?;
            let (place, joint) = self.joint_place(states, *link).ok()?;
            let [_, freedoms] = self.articulations[articulation].tree.range(own);
            let [at, speed] = joint.along(&states[place], *index);
            position += at.times(*factor);
            velocity += speed.times(*factor);
            places.push((articulation, freedoms.start + index, *factor));
        }
        Some((places, [position, velocity]))
    }
}

impl Joint {
    /// Appends the coordinates and velocities that `state` is.
    pub(crate) fn read<S: Scalar>(&self, state: &State<S>, q: &mut Vec<S>, v: &mut Vec<S>) {
        let (place, turn) = (&state.pose.translation.vector, &state.pose.rotation.coords);
        match self {
            Self::Spherical => {
                q.extend(turn.iter());
                v.extend(state.angular.iter());
            }
            Self::Floating => {
                q.extend(place.iter().chain(turn.iter()));
                v.extend(state.linear.iter().chain(state.angular.iter()));
            }
            Self::Fixed | Self::Revolute(_) | Self::Prismatic(_) | Self::Custom(_) => {
                q.extend(place.iter().take(self.coordinates()));
                v.extend(state.linear.iter().take(self.freedoms()));
            }
        }
    }

    /// The state that coordinates and velocities are.
    pub(crate) fn write<S: Scalar>(&self, q: &[S], v: &[S]) -> State<S> {
        let mut state = State::at_rest(Isometry3::identity());
        let rotation = |q: &[S]| {
            let [x, y, z, w] = [q[0], q[1], q[2], q[3]];
            Unit::new_normalize(Quaternion::new(w, x, y, z))
        };
        let copy = |to: &mut [S], from: &[S]| to[..from.len()].copy_from_slice(from);
        match self {
            Self::Spherical => {
                state.pose.rotation = rotation(q);
                copy(state.angular.as_mut_slice(), v);
            }
            Self::Floating => {
                copy(state.pose.translation.vector.as_mut_slice(), &q[..3]);
                state.pose.rotation = rotation(&q[3..]);
                copy(state.linear.as_mut_slice(), &v[..3]);
                copy(state.angular.as_mut_slice(), &v[3..]);
            }
            Self::Fixed | Self::Revolute(_) | Self::Prismatic(_) | Self::Custom(_) => {
                copy(state.pose.translation.vector.as_mut_slice(), q);
                copy(state.linear.as_mut_slice(), v);
            }
        }
        state
    }

    /// The rate of its state's velocities.
    fn rate_of_velocities<S: Scalar>(&self, accelerations: &[S]) -> Vector6<S> {
        let mut rate = Vector6::zeros();
        let first = if matches!(self, Self::Spherical) { 3 } else { 0 };
        rate.as_mut_slice()[first..first + accelerations.len()].copy_from_slice(accelerations);
        rate
    }

    /// The accelerations that a rate of its state's velocities is.
    pub(super) fn accelerations<S: Scalar>(&self, rate: &Vector6<S>) -> Vec<S> {
        let first = if matches!(self, Self::Spherical) { 3 } else { 0 };
        rate.as_slice()[first..first + self.freedoms()].to_vec()
    }

    /// The rate of its state's place, and the angular velocity of its rotation as one of the joint's frame.
    pub(crate) fn rate_of_pose<S: Scalar>(&self, state: &State<S>) -> [Vector3<S>; 2] {
        match self {
            Self::Spherical => [state.linear, state.pose.rotation * state.angular],
            Self::Floating => [state.linear, state.angular].map(|v| state.pose.rotation * v),
            Self::Fixed | Self::Revolute(_) | Self::Prismatic(_) | Self::Custom(_) => {
                [state.linear, state.angular]
            }
        }
    }

    /// Position and velocity along an axis: of a spherical joint, components of its rotation vector.
    fn along<S: Scalar>(&self, state: &State<S>, axis: usize) -> [S; 2] {
        match self {
            Self::Spherical => [so3_log(&state.pose.rotation)[axis], state.angular[axis]],
            _ => [state.pose.translation.vector[axis], state.linear[axis]],
        }
    }
}
