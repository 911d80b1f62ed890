//! Pose and velocity of a rigid body.

use nalgebra::{Isometry3, Vector3};

use crate::body::RigidBody;

/// Where a body is and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// `t_world_com`: origin at the centre of mass \[m\], axes of the model.
    pub pose: Isometry3<f64>,
    /// Velocity of the centre of mass, world frame \[m/s\].
    pub linear: Vector3<f64>,
    /// Angular velocity, world frame \[rad/s\].
    pub angular: Vector3<f64>,
}

impl State {
    /// `body` at rest with its model frame at `t_world_model`.
    pub fn at_rest(body: &RigidBody, t_world_model: &Isometry3<f64>) -> Self {
        let pose = body.com_pose(t_world_model);
        Self { pose, linear: Vector3::zeros(), angular: Vector3::zeros() }
    }

    /// Whether every coordinate is a finite number.
    pub fn is_finite(&self) -> bool {
        let pose = &self.pose;
        let parts = [pose.translation.vector, self.linear, self.angular];
        parts.iter().flat_map(|v| v.iter()).all(|x| x.is_finite())
            && pose.rotation.coords.iter().all(|x| x.is_finite())
    }
}
