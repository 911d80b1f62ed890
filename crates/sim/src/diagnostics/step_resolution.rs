//! Change of forces from one step to the next.

use nalgebra::{Vector3, Vector6};
use prehend_autodiff::Scalar;

use crate::body::RigidBody;
use crate::body_state::{BodyState, Rows};
use crate::handle::BodyId;
use crate::model::Model;
use crate::spatial::spatial;
use crate::time::Step;

/// Part of a body's speed below which a change of it is rounding, or an integrator's own error.
const NOISE: f64 = 1e-6;

/// Follows the velocities of free bodies and joints.
pub(super) struct StepResolution {
    bodies: Vec<BodyHistory>,
    joints: Vec<FollowedJoint>,
    sums: VelocityChanges,
}

/// Sums of the squared changes of velocity by contacts, and of the squared changes of these.
#[derive(Default)]
struct VelocityChanges {
    kicks: f64,
    changes: f64,
    /// The largest of the latter, whose it is, and when \[s\].
    largest: (f64, Option<(BodyId, f64)>),
}

impl VelocityChanges {
    fn add(&mut self, body: BodyId, step: Step, before: Option<Vector6<f64>>, kick: Vector6<f64>) {
        // Nothing is known of what was before the first step.
        let change = before.map_or(0.0, |before| (kick - before).norm_squared());
        self.kicks += kick.norm_squared();
        self.changes += change;
        if change > self.largest.0 {
            self.largest = (change, Some((body, step.start)));
        }
    }
}

/// The velocities of a joint's state.
fn velocity<S: Scalar>(state: &BodyState<S>) -> Vector6<f64> {
    let state = state.value();
    spatial(&state.linear, &state.angular)
}

/// A free body and what is known of its last step.
struct BodyHistory {
    body: BodyId,
    rigid: RigidBody,
    /// Radius of gyration \[m\].
    length: f64,
    /// Acceleration without contacts \[m/s²\].
    pull: Vector3<f64>,
    torque: Vector3<f64>,
    linear: Vector3<f64>,
    momentum: Vector3<f64>,
    kick: Option<Vector6<f64>>,
}

/// A joint and what is known of its last step.
struct FollowedJoint {
    place: usize,
    link: BodyId,
    velocity: Vector6<f64>,
    kick: Option<Vector6<f64>>,
}

impl StepResolution {
    pub(super) fn new<S: Scalar>(model: &Model<S>, initial: &Rows<S>) -> Self {
        let follow = |body: BodyId| {
            let rigid = model.bodies[body].rigid()?.map(S::value);
            let state = initial[body].value();
            let wrench = model.bodies[body].external_wrench.map(|x| x.value());
            Some(BodyHistory {
                body,
                length: rigid.gyration_radius(),
                pull: model.gravity.map(|x| x.value()) + wrench.fixed_rows::<3>(0) / rigid.mass(),
                torque: wrench.fixed_rows::<3>(3).into_owned(),
                linear: state.linear,
                momentum: rigid.momentum(&state.pose.rotation, &state.angular),
                rigid,
                kick: None,
            })
        };
        let bodies = model.free_bodies().into_iter().filter_map(follow).collect();
        let links = model.articulations.iter().flat_map(|own| own.bodies());
        let joints = model.joint_places().zip(links).map(|(place, link)| {
            let velocity = initial.get(place).map_or_else(Vector6::zeros, velocity);
            FollowedJoint { place, link: *link, velocity, kick: None }
        });
        let joints = joints.collect();
        Self { bodies, joints, sums: VelocityChanges::default() }
    }

    /// After `step` has led to `states`.
    #[inline]
    pub(super) fn step<S: Scalar>(&mut self, step: Step, states: &Rows<S>) {
        for followed in &mut self.bodies {
            let state = states[followed.body].value();
            let momentum = followed.rigid.momentum(&state.pose.rotation, &state.angular);
            let linear = state.linear - followed.linear - followed.pull * step.dt;
            let angular = momentum - followed.momentum - followed.torque * step.dt;
            let mut kick = spatial(&linear, &(angular / (followed.rigid.mass() * followed.length)));
            if kick.norm() < NOISE * state.speed_within(followed.length) {
                kick = Vector6::zeros();
            }
            (followed.linear, followed.momentum) = (state.linear, momentum);
            let before = followed.kick.replace(kick);
            self.sums.add(followed.body, step, before, kick);
        }
        for joint in &mut self.joints {
            let now = velocity(&states[joint.place]);
            let kick = now - joint.velocity;
            joint.velocity = now;
            let before = joint.kick.replace(kick);
            self.sums.add(joint.link, step, before, kick);
        }
    }

    /// The ratio of both root mean squares.
    pub(super) fn mean(&self) -> f64 {
        let VelocityChanges { kicks, changes, .. } = self.sums;
        if kicks > 0.0 { (changes / kicks).sqrt() } else { 0.0 }
    }

    /// The body with the largest change, and when \[s\].
    pub(super) fn roughest(&self) -> Option<(BodyId, f64)> {
        self.sums.largest.1
    }
}
