//! Readings of a robot's sensors.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use prehend_geometry::Inertial;
use prehend_geometry::mjcf::{FramePart, JointIndex, PlacedFrame, Quantity, Sensor};

use super::lengths::{Along, PathLengths};
use super::{MjcfError, MjcfRobot};
use crate::body_state::BodyState;
use crate::handle::BodyId;
use crate::model::Model;
use crate::state::State;

/// Quantities that sensors measure, with the bodies and lengths in a model.
#[derive(Clone, Debug, Default)]
pub(super) struct Sensors {
    all: Vec<Sensor>,
    /// The link that each joint moves.
    joints: BTreeMap<JointIndex, BodyId>,
    tendons: Vec<Along>,
    actuators: Vec<Along>,
    /// Each body's parent, mass \[kg\], center of mass and inertia.
    inertials: Vec<(Option<usize>, Option<Inertial>)>,
    t_world_mjcf: Isometry3<f64>,
}

impl Sensors {
    pub(super) fn new(lengths: &PathLengths<'_>) -> Self {
        let (mjcf, t_world_mjcf) = (lengths.mjcf, lengths.t_world_mjcf);
        let inertials = mjcf.bodies.iter().map(|body| (body.parent, body.inertial));
        Self {
            all: mjcf.sensors.clone(),
            joints: lengths.axes.iter().map(|(joint, axis, _)| (*joint, axis.link)).collect(),
            tendons: mjcf.tendons.iter().map(|own| lengths.of_tendon(own, 1.0)).collect(),
            actuators: mjcf.actuators.iter().map(|own| lengths.of_actuator(own)).collect(),
            inertials: inertials.collect(),
            t_world_mjcf,
        }
    }
}

/// Pose and velocities of a frame, world frame.
struct Moving {
    pose: Isometry3<f64>,
    linear: Vector3<f64>,
    angular: Vector3<f64>,
}

impl MjcfRobot {
    /// Names of the sensors whose readings follow from a state, in the order of the model.
    pub fn sensor_names(&self) -> impl Iterator<Item = &str> {
        self.sensors.all.iter().map(|sensor| sensor.name.as_str())
    }

    /// The reading of a sensor, in MuJoCo's order and units, without noise: see [`Quantity`].
    ///
    /// # Errors
    /// If there is no such sensor, an accelerometer is on what nothing moves, or it is no state of the model.
    pub fn sensor(&self, model: &Model, state: &State, name: &str) -> Result<Vec<f64>, MjcfError> {
        let sensor = self.sensors.all.iter().find(|own| own.name == name);
        let sensor = sensor.ok_or_else(|| MjcfError::NoSensor { name: name.to_owned() })?;
        let state = model.sensed(state)?;
        let mut numbers = self.measured(model, &state, &sensor.quantity)?;
        numbers.iter_mut().for_each(|x| *x = x.clamp(-sensor.cutoff, sensor.cutoff));
        Ok(numbers)
    }

    fn measured(
        &self,
        model: &Model,
        state: &State,
        quantity: &Quantity,
    ) -> Result<Vec<f64>, MjcfError> {
        let three = |v: Vector3<f64>| Ok(v.as_slice().to_vec());
        let along = |along: &Along, k: usize| Ok(vec![self.along(model, state, along)?[k]]);
        match quantity {
            Quantity::JointPosition(joint) => {
                let position = model.joint(state, self.sensors.joints[joint])?.position;
                Ok(match position[..] {
                    [i, j, k, w] => vec![w, i, j, k],
                    _ => position,
                })
            }
            Quantity::JointVelocity(joint) => {
                Ok(model.joint(state, self.sensors.joints[joint])?.velocity)
            }
            Quantity::TendonLength(k) => along(&self.sensors.tendons[*k], 0),
            Quantity::TendonVelocity(k) => along(&self.sensors.tendons[*k], 1),
            Quantity::ActuatorLength(k) => along(&self.sensors.actuators[*k], 0),
            Quantity::ActuatorVelocity(k) => along(&self.sensors.actuators[*k], 1),
            Quantity::Frame { part, frame, reference } => {
                let own = self.moving(state, frame);
                let base = reference.as_ref().map(|reference| self.moving(state, reference));
                Ok(part_of(*part, &own, base.as_ref()))
            }
            Quantity::Velocimeter(frame) => {
                let own = self.moving(state, frame);
                three(own.pose.rotation.inverse() * own.linear)
            }
            Quantity::Gyro(frame) => {
                let own = self.moving(state, frame);
                three(own.pose.rotation.inverse() * own.angular)
            }
            Quantity::Accelerometer(PlacedFrame { body, t_body_frame }) => {
                // Nothing moves the model.
                let Some(body) = body else {
                    let turn = self.sensors.t_world_mjcf.rotation * t_body_frame.rotation;
                    return three(turn.inverse() * -model.gravity);
                };
                let point = t_body_frame.translation.vector.into();
                let felt = model.accelerometer(self.bodies[*body], &point, state)?;
                three(t_body_frame.rotation.inverse() * felt)
            }
            Quantity::SubtreeCenter(body) => three(self.subtree(state, *body)[0]),
            Quantity::SubtreeVelocity(body) => three(self.subtree(state, *body)[1]),
            Quantity::SubtreeMomentum(body) => three(self.subtree(state, *body)[2]),
        }
    }

    /// A length and its rate.
    fn along(&self, model: &Model, state: &State, along: &Along) -> Result<[f64; 2], MjcfError> {
        let mut sum = [0.0; 2];
        match along {
            Along::Joints(axes) => {
                for (axis, factor) in axes {
                    let motion = model.joint_motion(state, *axis)?;
                    sum = [0, 1].map(|k| sum[k] + factor * motion[k]);
                }
            }
            Along::Path(path) => {
                let (articulation, _) = model.link_of(self.bodies[0])?;
                let own = &model.articulations[articulation];
                let [q, v] = own.coordinates(&state.rows()[model.joint_range(articulation)]);
                let length = path.length(&own.tree.kinematics(&q, &v), &q, false);
                let rate = length.slopes.iter().zip(&v).map(|(slope, v)| slope * v).sum();
                sum = [length.value, rate];
            }
        }
        Ok(sum)
    }

    fn moving(&self, state: &State, PlacedFrame { body, t_body_frame }: &PlacedFrame) -> Moving {
        let Some(body) = body else {
            let pose = self.sensors.t_world_mjcf * t_body_frame;
            return Moving { pose, linear: Vector3::zeros(), angular: Vector3::zeros() };
        };
        let BodyState { pose, linear, angular } = state[self.bodies[*body]];
        let arm = pose.rotation * t_body_frame.translation.vector;
        Moving { pose: pose * t_body_frame, linear: linear + angular.cross(&arm), angular }
    }

    /// Center of mass of a body and all that it carries, its velocity, and the angular momentum about it.
    fn subtree(&self, state: &State, body: Option<usize>) -> [Vector3<f64>; 3] {
        let mut is_inside = vec![body.is_none(); self.bodies.len()];
        let mut parts = Vec::new();
        for (k, (parent, inertial)) in self.sensors.inertials.iter().enumerate() {
            is_inside[k] |= body == Some(k) || parent.is_some_and(|parent| is_inside[parent]);
            let Some(inertial) = inertial.as_ref().filter(|_| is_inside[k]) else { continue };
            let t_body_frame = inertial.com.coords.into();
            parts
                .push((inertial, self.moving(state, &PlacedFrame { body: Some(k), t_body_frame })));
        }
        let mass: f64 = parts.iter().map(|(own, _)| own.mass).sum();
        let mean = |of: fn(&Moving) -> Vector3<f64>| {
            let sum: Vector3<f64> = parts.iter().map(|(own, moving)| of(moving) * own.mass).sum();
            sum / mass.max(f64::MIN_POSITIVE)
        };
        let center = mean(|moving| moving.pose.translation.vector);
        let velocity = mean(|moving| moving.linear);
        let momentum = parts.iter().map(|(own, moving)| {
            let rotation = moving.pose.rotation.to_rotation_matrix();
            let arm = moving.pose.translation.vector - center;
            rotation * (own.inertia * (rotation.inverse() * moving.angular))
                + arm.cross(&(moving.linear - velocity)) * own.mass
        });
        let momentum = momentum.sum();
        [center, velocity, momentum]
    }
}

/// A part of a frame's pose or velocity, in another or in the model.
fn part_of(part: FramePart, own: &Moving, base: Option<&Moving>) -> Vec<f64> {
    let still =
        Moving { pose: Isometry3::identity(), linear: Vector3::zeros(), angular: Vector3::zeros() };
    let base = base.unwrap_or(&still);
    let back: UnitQuaternion<f64> = base.pose.rotation.inverse();
    let arm = own.pose.translation.vector - base.pose.translation.vector;
    let vector = match part {
        FramePart::Position => back * arm,
        FramePart::Orientation => {
            let turn = back * own.pose.rotation;
            return vec![turn.w, turn.i, turn.j, turn.k];
        }
        FramePart::Axis(axis) => back * (own.pose.rotation * Vector3::ith(axis, 1.0)),
        FramePart::LinearVelocity => back * (own.linear - base.linear - base.angular.cross(&arm)),
        FramePart::AngularVelocity => back * (own.angular - base.angular),
    };
    vector.as_slice().to_vec()
}
