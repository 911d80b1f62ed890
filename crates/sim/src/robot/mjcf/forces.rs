//! What acts along the joints and tendons of a model.

use std::sync::Arc;

use nalgebra::Isometry3;
use prehend_geometry::mjcf::{
    Actuator, Dynamics, Joint, JointIndex, JointKind, Model, SolverParameters, Tendon, Transmission,
};

use super::super::constraints::{Mobility, limits, losses};
use super::MjcfError;
use super::lengths::{Along, Lengths, length_and_inertia};
use crate::handle::BodyId;
use crate::handle::JointForceId;
use crate::joint_law::activation::Activation;
use crate::joint_law::affine_actuator::AffineActuator;
use crate::joint_law::dynamic::DynJointLaw;
use crate::joint_law::polynomial::{PolynomialDamper, PolynomialSpring};
use crate::joint_law::slack_spring::SlackSpring;
use crate::joint_law::spring::JointSpring;
use crate::world::World;
use crate::world::joint_force::JointAxis;
use crate::world::path::{Path, PathPart};
use crate::world::transmission::Rotor;

/// Adds forces along joints.
pub(super) struct Forces<'a> {
    pub(super) world: &'a mut World,
    pub(super) model: &'a Model,
    pub(super) lengths: Lengths<'a>,
    /// The first link.
    pub(super) link: BodyId,
    /// The axis whose velocity is the state of each actuator that has one.
    pub(super) activations: Vec<Option<BodyId>>,
    pub(super) mobility: &'a Mobility,
    /// Coordinates with all joints at their references, and at the references of their springs.
    pub(super) references: [Vec<f64>; 2],
    pub(super) actuators: Vec<(String, JointForceId)>,
}

impl Forces<'_> {
    pub(super) fn add_all(&mut self) -> Result<(), MjcfError> {
        let model = self.model;
        for (place, index) in model.joint_indices().enumerate() {
            let (_, axis, link) = self.lengths.axes[place];
            self.add_joint(index, model.joint(index), axis, link)?;
        }
        for tendon in &model.tendons {
            self.add_tendon(tendon)?;
        }
        for (index, actuator) in model.actuators.iter().enumerate() {
            self.add_actuator(actuator, self.activations[index])?;
        }
        Ok(())
    }

    fn add(
        &mut self,
        along: &Along,
        law: Arc<dyn DynJointLaw>,
    ) -> Result<Option<JointForceId>, MjcfError> {
        Ok(match along {
            Along::Joints(axes) if axes.is_empty() => None,
            Along::Joints(axes) => Some(self.world.add_coupled_force(axes, law)?),
            Along::Path(path) => {
                Some(self.world.add_path_force(self.link, Arc::clone(path), law)?)
            }
            Along::Contacts => None,
        })
    }

    /// The inertia along a length with all joints at their references, and the length there where it is a path.
    fn inertia(&self, along: &Along) -> [f64; 2] {
        match along {
            Along::Joints(axes) => [0.0, self.world.inertia_along(self.mobility, axes)],
            Along::Path(path) => {
                let own = &self.world.articulations[self.world.articulations.len() - 1];
                length_and_inertia(&own.tree, &self.references[0], path)
            }
            Along::Contacts => [0.0; 2],
        }
    }

    fn add_joint(
        &mut self,
        index: JointIndex,
        joint: &Joint,
        first: JointAxis,
        link: usize,
    ) -> Result<(), MjcfError> {
        if matches!(joint.kind, JointKind::Ball | JointKind::Free) {
            return self.add_turning_joint(index, joint, link);
        }
        let along = Along::Joints(vec![(first, 1.0)]);
        let rest = joint.spring_reference;
        if joint.higher_stiffness != [0.0; 2] {
            let ([b, c], slack) = (joint.higher_stiffness, [rest; 2]);
            let coefficients = [joint.stiffness, b, c];
            self.add(&along, Arc::new(PolynomialSpring { coefficients, slack }))?;
        } else if joint.stiffness > 0.0 {
            let stiffness = joint.stiffness;
            self.add(&along, Arc::new(JointSpring { stiffness, rest }))?;
        }
        self.add_losses(&along, (joint.damping, joint.higher_damping), joint.friction_loss)?;
        if let Some((low, high)) = joint.actuator_force_range {
            let bound = (first, [low, high], joint.carries_by_actuator);
            self.world.transmissions.bounds.push(bound);
        }
        if let Some(range) = joint.range {
            self.add_limits(&Along::Joints(vec![(first, 1.0)]), range, &joint.limit_solver)?;
        }
        Ok(())
    }

    /// Springs, dampers and limits of a ball joint or a free one, along each of its directions.
    fn add_turning_joint(
        &mut self,
        index: JointIndex,
        joint: &Joint,
        link: usize,
    ) -> Result<(), MjcfError> {
        let is_free = joint.kind == JointKind::Free;
        let reference = match is_free {
            true => self.model.bodies[index.body].t_parent_body,
            false => Isometry3::identity(),
        };
        for k in 0..joint.kind.velocities() {
            if joint.damping <= 0.0 && joint.stiffness <= 0.0 {
                break;
            }
            let mut gear = [0.0; 6];
            gear[k] = 1.0;
            let (in_parent, reference) = (false, Some(reference));
            let part = PathPart::Turn { link, gear, is_free, in_parent, reference };
            let along = Along::Path(Arc::new(Path(vec![part])));
            for law in losses(joint.damping, 0.0) {
                self.add(&along, law)?;
            }
            if joint.stiffness > 0.0 {
                let law = JointSpring { stiffness: joint.stiffness, rest: 0.0 };
                self.add(&along, Arc::new(law))?;
            }
        }
        if let Some(range) = joint.range {
            let along = Along::Path(Arc::new(Path(vec![PathPart::Angle { link }])));
            self.add_limits(&along, range, &joint.limit_solver)?;
        }
        Ok(())
    }

    fn add_losses(
        &mut self,
        along: &Along,
        (damping, [b, c]): (f64, [f64; 2]),
        friction: f64,
    ) -> Result<(), MjcfError> {
        let is_linear = [b, c] == [0.0; 2];
        if !is_linear {
            self.add(along, Arc::new(PolynomialDamper { coefficients: [damping, b, c] }))?;
        }
        for law in losses(if is_linear { damping } else { 0.0 }, friction) {
            self.add(along, law)?;
        }
        Ok(())
    }

    fn add_limits(
        &mut self,
        along: &Along,
        range: (f64, f64),
        solver: &SolverParameters,
    ) -> Result<(), MjcfError> {
        let [_, inertia] = self.inertia(along);
        let [stiffness, _] = stiffness(solver, inertia, 1.0);
        self.add(along, limits(range, stiffness)).map(|_| ())
    }

    fn add_tendon(&mut self, tendon: &Tendon) -> Result<(), MjcfError> {
        let along = self.lengths.of_tendon(tendon, 1.0);
        self.add_losses(&along, (tendon.damping, tendon.higher_damping), tendon.friction_loss)?;
        if tendon.stiffness > 0.0 || tendon.higher_stiffness != [0.0; 2] {
            let (lower, upper) = tendon.spring_range.unwrap_or_else(|| {
                let own = &self.world.articulations[self.world.articulations.len() - 1];
                let [length, _] = match &along {
                    Along::Path(path) => length_and_inertia(&own.tree, &self.references[1], path),
                    _ => [0.0; 2],
                };
                (length, length)
            });
            let (stiffness, [b, c]) = (tendon.stiffness, tendon.higher_stiffness);
            let law: Arc<dyn DynJointLaw> = match [b, c] == [0.0; 2] {
                true => Arc::new(SlackSpring { stiffness, lower, upper }),
                false => {
                    let (coefficients, slack) = ([stiffness, b, c], [lower, upper]);
                    Arc::new(PolynomialSpring { coefficients, slack })
                }
            };
            self.add(&along, law)?;
        }
        if let Some(range) = tendon.range {
            self.add_limits(&along, range, &tendon.limit_solver)?;
        }
        if tendon.armature > 0.0 {
            let (axes, path) = match along {
                Along::Joints(axes) => (axes, None),
                Along::Path(path) => (Vec::new(), Some(path)),
                Along::Contacts => return Ok(()),
            };
            let (link, inertia) = (self.link, tendon.armature);
            self.world.transmissions.rotors.push(Rotor { link, axes, path, inertia });
        }
        Ok(())
    }

    fn add_actuator(
        &mut self,
        actuator: &Actuator,
        activation: Option<BodyId>,
    ) -> Result<(), MjcfError> {
        const EVERYTHING: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
        let range = |range: Option<(f64, f64)>| range.map_or(EVERYTHING, |(a, b)| [a, b]);
        let along = self.lengths.of_actuator(actuator);
        let mut bias = actuator.bias;
        if let Some(ratio) = actuator.damping_ratio {
            let [_, inertia] = self.inertia(&along);
            bias[2] = -2.0 * ratio * (actuator.gain[0] * inertia).sqrt();
        }
        let bound = match actuator.transmission {
            Transmission::Tendon(index) => {
                let bound = self.model.tendons[index].actuator_force_range;
                bound.map(|(low, high)| (index, [low, high]))
            }
            _ => None,
        };
        let mut law = AffineActuator {
            control: 0.0,
            gain: actuator.gain,
            bias,
            control_range: range(actuator.control_range),
            force_range: range(actuator.force_range),
            period: period(actuator, self.model),
        };
        let mut controlled = None;
        if let Some(link) = activation {
            let time_constant = match actuator.dynamics {
                Dynamics::Filter(constant) => constant,
                _ => 0.0,
            };
            let (control_range, range) = (law.control_range, range(actuator.activation_range));
            let state = Activation { control: 0.0, time_constant, control_range, range };
            controlled = Some(self.world.add_joint_force(link, state)?);
            law.control_range = EVERYTHING;
        }
        let Some(id) = self.add(&along, Arc::new(law))? else { return Ok(()) };
        let force = self.world.joint_force_mut(id);
        force.is_actuator = true;
        force.input = activation.map(|link| (link.into(), actuator.ahead));
        force.bound = bound;
        self.actuators.push((actuator.name.clone(), controlled.unwrap_or(id)));
        Ok(())
    }
}

/// Once around in the length of a servo that turns something; zero of others.
fn period(actuator: &Actuator, model: &Model) -> f64 {
    let [a, b, c, u, v, w] = actuator.gear;
    let torque = match &actuator.transmission {
        Transmission::Joint { joint, .. } if model.joint(*joint).kind == JointKind::Ball => {
            [a, b, c]
        }
        Transmission::Site { reference: Some(_), .. } if [a, b, c] == [0.0; 3] => [u, v, w],
        _ => [0.0; 3],
    };
    let is_servo = actuator.gain[1..] == [0.0; 2] && actuator.gain[0] == -actuator.bias[1];
    f64::from(is_servo) * std::f64::consts::TAU * nalgebra::Vector3::from(torque).norm()
}

/// Stiffness and damping of a constraint on what has this inertia, with time constants of a part of those in the file.
pub(super) fn stiffness(solver: &SolverParameters, inertia: f64, softness: f64) -> [f64; 2] {
    let ([time, ratio], most) = (solver.reference, solver.impedance[1]);
    if time < 0.0 && ratio < 0.0 {
        let (stiffness, damping) = (-time / (most * most), -ratio / most);
        return [stiffness * inertia / (softness * softness), damping * inertia / softness];
    }
    let time = time * softness;
    let stiffness = inertia / (most * time * ratio).powi(2);
    [stiffness, 2.0 * inertia / (most * time)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stiffness_and_damping_are_those_of_the_time_constant() {
        // As MuJoCo's documentation has it: 1/(d² t² ζ²) and 2/(d t).
        let impedance = [0.9, 0.8, 0.001, 0.5, 2.0];
        let relative = |found: [f64; 2], expected: [f64; 2]| {
            let off = |k: usize| (found[k] / expected[k] - 1.0).abs();
            assert!(off(0) < 1e-12 && off(1) < 1e-12, "{found:?} {expected:?}");
        };
        for softness in [1.0, 0.25] {
            let given = SolverParameters { reference: [0.02, 0.5], impedance };
            let time = 0.8 * 0.02 * softness;
            let expected = [3.0 / (time * 0.5_f64).powi(2), 2.0 * 3.0 / time];
            relative(stiffness(&given, 3.0, softness), expected);
            let direct = SolverParameters { reference: [-100.0, -5.0], impedance };
            let expected = [3.0 * 100.0 / 0.64 / softness.powi(2), 3.0 * 5.0 / 0.8 / softness];
            relative(stiffness(&direct, 3.0, softness), expected);
        }
    }
}
