//! The state of a joint in a model: its coordinates are the pose of a [`BodyState`], its velocities the velocities.
//!
//! Numbers come first in place and velocity; a rotation and its angular velocity, along the link's axes, are those of the state.

use std::ops::Range;

use nalgebra::{Isometry3, Unit, Vector3, Vector6};
use prehend_autodiff::Scalar;
use prehend_autodiff::lie::{so3_log, so3_right_jacobian_inverse};

use super::joint::Joint;
use crate::body_state::BodyState;

/// Positions and velocities: of one joint, or of all that moves in a model.
#[derive(Clone, Debug, PartialEq)]
pub struct JointState<S = f64> {
    /// Positions \[rad or m\].
    pub position: Vec<S>,
    /// Velocities \[rad/s or m/s\].
    pub velocity: Vec<S>,
}

impl Joint {
    /// Ranges of its coordinates and velocities among the [numbers](BodyState::coordinates) of its state.
    pub(crate) fn places(&self) -> [Range<usize>; 2] {
        let [q, v] = if matches!(self, Self::Spherical) { [3, 10] } else { [0, 7] };
        [q..q + self.nq(), v..v + self.nv()]
    }

    /// Appends the coordinates and velocities that `state` is.
    pub(crate) fn read<S: Scalar>(&self, state: &BodyState<S>, q: &mut Vec<S>, v: &mut Vec<S>) {
        let (numbers, [of_q, of_v]) = (state.coordinates(), self.places());
        q.extend_from_slice(&numbers[of_q]);
        v.extend_from_slice(&numbers[of_v]);
    }

    /// The state that coordinates and velocities are.
    pub(crate) fn write<S: Scalar>(&self, q: &[S], v: &[S]) -> BodyState<S> {
        let [of_q, of_v] = self.places();
        let mut numbers = BodyState::at_rest(Isometry3::identity()).coordinates();
        numbers[of_q].copy_from_slice(q);
        numbers[of_v].copy_from_slice(v);
        let mut state = BodyState::from_coordinates(&numbers);
        if self.turns() {
            state.pose.rotation = Unit::new_normalize(state.pose.rotation.into_inner());
        }
        state
    }

    /// The rate of its state's velocities.
    pub(crate) fn rate_of_velocities<S: Scalar>(&self, accelerations: &[S]) -> Vector6<S> {
        let mut rate = Vector6::zeros();
        rate.as_mut_slice()[self.velocities()].copy_from_slice(accelerations);
        rate
    }

    /// The accelerations that a rate of its state's velocities is.
    pub(crate) fn accelerations<S: Scalar>(&self, rate: &Vector6<S>) -> Vec<S> {
        rate.as_slice()[self.velocities()].to_vec()
    }

    /// Range of the joint's own velocities among a state's six, linear and angular.
    fn velocities(&self) -> Range<usize> {
        let [_, numbers] = self.places();
        numbers.start - 7..numbers.end - 7
    }

    /// The rate of its state's place, and the angular velocity of its rotation as one of the joint's frame.
    pub(crate) fn rate_of_pose<S: Scalar>(&self, state: &BodyState<S>) -> [Vector3<S>; 2] {
        match self {
            Self::Spherical => [state.linear, state.pose.rotation * state.angular],
            Self::Floating => [state.linear, state.angular].map(|v| state.pose.rotation * v),
            Self::Placed => [Vector3::zeros(); 2],
            Self::Fixed | Self::Revolute(_) | Self::Prismatic(_) | Self::Custom(_) => {
                [state.linear, state.angular]
            }
        }
    }

    /// Derivatives of the position along an axis by displacements along all.
    pub(crate) fn position_slopes<S: Scalar>(&self, state: &BodyState<S>, axis: usize) -> [S; 3] {
        match self {
            Self::Spherical => {
                let turn = so3_log(&state.pose.rotation);
                so3_right_jacobian_inverse(&turn).row(axis).transpose().into()
            }
            _ => std::array::from_fn(|k| if k == axis { S::one() } else { S::zero() }),
        }
    }

    /// Position and velocity along an axis: of a spherical joint, a component of its rotation vector and its rate.
    pub(crate) fn along<S: Scalar>(&self, state: &BodyState<S>, axis: usize) -> [S; 2] {
        match self {
            Self::Spherical => {
                let slopes = Vector3::from(self.position_slopes(state, axis));
                [so3_log(&state.pose.rotation)[axis], slopes.dot(&state.angular)]
            }
            _ => [state.pose.translation.vector[axis], state.linear[axis]],
        }
    }
}
