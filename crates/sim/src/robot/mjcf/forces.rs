//! What acts along the joints of a model.

use std::sync::Arc;

use nalgebra::DMatrix;
use prehend_geometry::mjcf::{
    Dynamics, Joint, JointIndex, JointKind, Model, SolverParameters, Tendon, Transmission,
};

use super::MjcfError;
use crate::joint_law::JointLaw;
use crate::joint_law::affine_actuator::AffineActuator;
use crate::joint_law::slack_spring::SlackSpring;
use crate::joint_law::spring::JointSpring;
use crate::world::World;
use crate::world::joint_force::{JointAxis, JointForceId};

/// Adds forces along joints.
pub(super) struct Forces<'a> {
    world: &'a mut World,
    model: &'a Model,
    /// Of each joint of the model.
    axes: Vec<JointAxis>,
    /// Inverse of the mass matrix with all joints at their neutral coordinates.
    inverse: &'a DMatrix<f64>,
    warnings: &'a mut Vec<String>,
    pub(super) actuators: Vec<(String, JointForceId)>,
}

impl<'a> Forces<'a> {
    pub(super) fn new(
        world: &'a mut World,
        model: &'a Model,
        axes: Vec<JointAxis>,
        inverse: &'a DMatrix<f64>,
        warnings: &'a mut Vec<String>,
    ) -> Self {
        Self { world, model, axes, inverse, warnings, actuators: Vec::new() }
    }

    pub(super) fn add_all(&mut self) -> Result<(), MjcfError> {
        let model = self.model;
        for index in model.joint_indices() {
            self.add_joint(index, model.joint(index))?;
        }
        for tendon in &model.tendons {
            self.add_tendon(tendon)?;
        }
        self.add_actuators()
    }

    fn axis(&self, joint: JointIndex) -> JointAxis {
        let place = self.model.joint_indices().position(|own| own == joint);
        self.axes[place.unwrap_or_default()]
    }

    fn add(
        &mut self,
        axes: &[(JointAxis, f64)],
        law: impl JointLaw,
    ) -> Result<JointForceId, MjcfError> {
        Ok(self.world.add_coupled_force(axes, Arc::new(law))?)
    }

    fn add_joint(&mut self, index: JointIndex, joint: &Joint) -> Result<(), MjcfError> {
        let first = self.axis(index);
        let count = match joint.kind {
            JointKind::Free => return Ok(()),
            kind => kind.velocities(),
        };
        for k in 0..count {
            let axis = [(JointAxis { index: k, ..first }, 1.0)];
            self.world.add_losses(&axis, joint.damping, joint.friction_loss)?;
            if joint.stiffness > 0.0 {
                let rest = if joint.kind == JointKind::Ball { 0.0 } else { joint.spring_reference };
                self.add(&axis, JointSpring { stiffness: joint.stiffness, rest })?;
            }
        }
        match (joint.range, joint.kind) {
            (Some(_), JointKind::Ball) => {
                self.warnings.push(format!("joint '{}': the limit of a ball joint", joint.name));
            }
            (Some(range), _) => self.add_limits(&[(first, 1.0)], range, &joint.limit_solver)?,
            (None, _) => {}
        }
        Ok(())
    }

    fn add_limits(
        &mut self,
        axes: &[(JointAxis, f64)],
        range: (f64, f64),
        solver: &SolverParameters,
    ) -> Result<(), MjcfError> {
        let inertia = self.world.inertia_along(self.inverse, axes);
        let [stiffness, _] = stiffness(solver, inertia, 1.0);
        Ok(self.world.add_limits(axes, range, stiffness)?)
    }

    fn add_tendon(&mut self, tendon: &Tendon) -> Result<(), MjcfError> {
        let axes = self.along(tendon, 1.0);
        self.world.add_losses(&axes, tendon.damping, tendon.friction_loss)?;
        if tendon.stiffness > 0.0 {
            let (stiffness, (lower, upper)) = (tendon.stiffness, tendon.spring_range);
            self.add(&axes, SlackSpring { stiffness, lower, upper })?;
        }
        if let Some(range) = tendon.range {
            self.add_limits(&axes, range, &tendon.limit_solver)?;
        }
        if tendon.armature > 0.0 {
            self.warnings.push(format!("tendon '{}': its armature", tendon.name));
        }
        Ok(())
    }

    fn along(&self, tendon: &Tendon, factor: f64) -> Vec<(JointAxis, f64)> {
        let joints = tendon.joints.iter();
        joints.map(|part| (self.axis(part.joint), factor * part.coefficient)).collect()
    }

    fn add_actuators(&mut self) -> Result<(), MjcfError> {
        let everything = [f64::NEG_INFINITY, f64::INFINITY];
        for actuator in &self.model.actuators {
            if actuator.dynamics != Dynamics::Direct {
                self.warnings.push(format!("actuator '{}': its dynamics", actuator.name));
            }
            let axes = match actuator.transmission {
                Transmission::Joint(joint) => vec![(self.axis(joint), actuator.gear)],
                Transmission::Tendon(index) => {
                    self.along(&self.model.tendons[index], actuator.gear)
                }
            };
            let range = |range: Option<(f64, f64)>| range.map_or(everything, |(a, b)| [a, b]);
            let law = AffineActuator {
                control: 0.0,
                gain: actuator.gain,
                bias: actuator.bias,
                control_range: range(actuator.control_range),
                force_range: range(actuator.force_range),
            };
            let id = self.add(&axes, law)?;
            self.actuators.push((actuator.name.clone(), id));
        }
        Ok(())
    }
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
