//! Actuators of a model.

use std::sync::Arc;

use prehend_geometry::mjcf::{
    self, Actuator, Dynamics, JointKind, Model as MjcfModel, Transmission,
};

use super::MjcfError;
use super::forces::Forces;
use super::lengths::Along;
use crate::handle::BodyId;
use crate::joint_law::affine_actuator::AffineActuator;
use crate::joint_law::dynamic::DynJointLaw;
use crate::joint_law::muscle::{Muscle, MuscleActivation};

impl Forces<'_> {
    pub(super) fn add_actuator(
        &mut self,
        actuator: &Actuator,
        activation: Option<BodyId>,
    ) -> Result<(), MjcfError> {
        const EVERYTHING: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
        let range = |range: Option<(f64, f64)>| range.map_or(EVERYTHING, |(a, b)| [a, b]);
        let along = self.lengths.of_actuator(actuator);
        let mut bias = actuator.bias;
        if let Some(ratio) = actuator.damping_ratio {
            bias[2] = -2.0 * ratio * (actuator.gain[0] * self.inertia(&along)).sqrt();
        }
        let bound = match actuator.transmission {
            Transmission::Tendon(index) => {
                let bound = self.mjcf.tendons[index].actuator_force_range;
                bound.map(|(low, high)| (index, [low, high]))
            }
            _ => None,
        };
        let control_range = range(actuator.control_range);
        let affine = AffineActuator {
            control: 0.0,
            gain: actuator.gain,
            bias,
            control_range: EVERYTHING,
            force_range: EVERYTHING,
            rate_range: EVERYTHING,
            period: 0.0,
        };
        let mut controlled = None;
        if let Some(link) = activation {
            let state: Arc<dyn DynJointLaw> = match actuator.dynamics {
                Dynamics::Muscle([activating, deactivating, smoothing]) => {
                    Arc::new(MuscleActivation { control: 0.0, activating, deactivating, smoothing })
                }
                dynamics => {
                    // Its velocity is the activation.
                    let [gain, bias] = match dynamics {
                        Dynamics::Filter(time) if time > 0.0 => {
                            [[1.0 / time, 0.0, 0.0], [0.0, 0.0, -1.0 / time]]
                        }
                        _ => [[1.0, 0.0, 0.0], [0.0; 3]],
                    };
                    let rate_range = range(actuator.activation_range);
                    Arc::new(AffineActuator { gain, bias, control_range, rate_range, ..affine })
                }
            };
            controlled = Some(self.model.add_coupled_force(&[(link.into(), 1.0)], state)?);
        }
        let law: Arc<dyn DynJointLaw> = match &actuator.muscle {
            Some(muscle) => Arc::new(self.muscle(muscle, &along)),
            None => Arc::new(AffineActuator {
                control_range: if activation.is_some() { EVERYTHING } else { control_range },
                force_range: range(actuator.force_range),
                period: period(actuator, self.mjcf),
                ..affine
            }),
        };
        let Some(id) = self.add(&along, law)? else { return Ok(()) };
        let force = self.model.joint_force_mut(id);
        force.is_actuator = true;
        force.input = activation.map(|link| (link.into(), actuator.ahead));
        force.bound = bound;
        self.actuators.push((actuator.name.clone(), controlled.unwrap_or(id)));
        Ok(())
    }

    fn muscle(&self, own: &mjcf::Muscle, along: &Along) -> Muscle {
        let force = own.force.unwrap_or_else(|| {
            let (_, slopes) = self.length(along, &self.references[0]);
            own.scale / self.mobility.times(&slopes).norm()
        });
        let mjcf::Muscle { origin, unit, fastest, passive, stretching, .. } = *own;
        let ([shortest, longest], activation) = (own.lengths, 0.0);
        Muscle { activation, force, origin, unit, shortest, longest, fastest, passive, stretching }
    }
}

/// Once around in the length of a servo that turns something; zero of others.
fn period(actuator: &Actuator, mjcf: &MjcfModel) -> f64 {
    let [a, b, c, u, v, w] = actuator.gear;
    let torque = match &actuator.transmission {
        Transmission::Joint { joint, .. } if mjcf.joint(*joint).kind == JointKind::Ball => {
            [a, b, c]
        }
        Transmission::Site { reference: Some(_), .. } if [a, b, c] == [0.0; 3] => [u, v, w],
        _ => [0.0; 3],
    };
    let is_servo = actuator.gain[1..] == [0.0; 2] && actuator.gain[0] == -actuator.bias[1];
    f64::from(is_servo) * std::f64::consts::TAU * nalgebra::Vector3::from(torque).norm()
}
