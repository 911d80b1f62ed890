//! Forces along the joints and tendons of a model.

use std::sync::Arc;

use nalgebra::{DMatrix, Isometry3};
use prehend_geometry::mjcf::{
    EqualityKind, Joint, JointIndex, JointKind, Model as MjcfModel, SolverParameters, Tendon,
};

use super::super::constraints::{Mobility, limits, losses};
use super::MjcfError;
use super::lengths::{Along, PathLengths};
use crate::handle::{BodyId, JointForceId};
use crate::joint_law::dynamic::DynJointLaw;
use crate::joint_law::friction::PolynomialDamper;
use crate::joint_law::linear::{JointDamper, JointSpring};
use crate::joint_law::range::{PolynomialSpring, SlackSpring};
use crate::model::Model;
use crate::model::joint_force::JointAxis;
use crate::model::path::{Path, PathPart};
use crate::model::transmission::Rotor;

/// Adds forces along joints.
pub(super) struct Forces<'a> {
    pub(super) model: &'a mut Model,
    pub(super) mjcf: &'a MjcfModel,
    pub(super) lengths: PathLengths<'a>,
    /// The first link.
    pub(super) link: BodyId,
    /// The axis whose velocity is the state of each actuator that has one.
    pub(super) activations: Vec<Option<BodyId>>,
    /// With all joints at their references.
    pub(super) mobility: &'a Mobility,
    /// Time constants of couplings as a part of those in the file.
    pub(super) softness: f64,
    /// Coordinates with all joints at their references, and at the references of their springs.
    pub(super) references: &'a [Vec<f64>; 2],
    /// Inertias that move with tendons, and the slopes of their lengths by all degrees of freedom at the references.
    pub(super) rotors: Vec<(f64, DMatrix<f64>)>,
    pub(super) actuators: Vec<(String, JointForceId)>,
}

impl Forces<'_> {
    pub(super) fn add_all(&mut self) -> Result<(), MjcfError> {
        let mjcf = self.mjcf;
        for tendon in mjcf.tendons.iter().filter(|tendon| tendon.armature > 0.0) {
            let along = self.lengths.of_tendon(tendon, 1.0);
            self.rotors.push((tendon.armature, self.length(&along, &self.references[0]).1));
            let (axes, path) = match along {
                Along::Joints(axes) => (axes, None),
                Along::Path(path) => (Vec::new(), Some(path)),
            };
            let (link, inertia) = (self.link, tendon.armature);
            self.model.transmissions.rotors.push(Rotor { link, axes, path, inertia });
        }
        for (place, index) in mjcf.joint_indices().enumerate() {
            let (_, axis, link) = self.lengths.axes[place];
            self.add_joint(index, mjcf.joint(index), axis, link)?;
        }
        for tendon in &mjcf.tendons {
            self.add_tendon(tendon)?;
        }
        for equality in mjcf.equalities.iter().filter(|equality| equality.active) {
            let joint = |own| Along::Joints(vec![(self.lengths.axis(own).0, 1.0)]);
            let tendon = |own: usize| self.lengths.of_tendon(&mjcf.tendons[own], 1.0);
            let (first, second, polynomial) = match &equality.kind {
                EqualityKind::Joint { joints: (first, second), polynomial } => {
                    (joint(*first), second.map(joint), polynomial)
                }
                EqualityKind::Tendon { tendons: (first, second), polynomial } => {
                    (tendon(*first), second.map(tendon), polynomial)
                }
                _ => continue,
            };
            self.couple(first, second, polynomial, &equality.solver)?;
        }
        for (index, actuator) in mjcf.actuators.iter().enumerate() {
            self.add_actuator(actuator, self.activations[index])?;
        }
        Ok(())
    }

    pub(super) fn add(
        &mut self,
        along: &Along,
        law: Arc<dyn DynJointLaw>,
    ) -> Result<Option<JointForceId>, MjcfError> {
        Ok(match along {
            Along::Joints(axes) if axes.is_empty() => None,
            Along::Joints(axes) => Some(self.model.add_coupled_force(axes, law)?),
            Along::Path(path) => {
                Some(self.model.add_path_force(self.link, Arc::clone(path), law)?)
            }
        })
    }

    /// A length with the joints at coordinates `q`, and its slopes by all degrees of freedom.
    pub(super) fn length(&self, along: &Along, q: &[f64]) -> (f64, DMatrix<f64>) {
        let tree = &self.model.articulations[self.model.articulations.len() - 1].tree;
        let n = tree.nv();
        match along {
            Along::Joints(axes) => {
                let slopes = self.model.slopes_along(axes, n);
                let position = |(axis, factor): &(JointAxis, f64)| {
                    let (_, link) = self.model.link_of(axis.link).ok()?;
                    Some(factor * q[tree.range(link)[0].start + axis.index])
                };
                (axes.iter().filter_map(position).sum(), slopes)
            }
            Along::Path(path) => {
                let length = path.length(&tree.kinematics(q, &vec![0.0; n]), q, false);
                (length.value, DMatrix::from_vec(n, 1, length.slopes))
            }
        }
    }

    /// The parts of a way of this length.
    fn parts(&self, along: Along) -> Vec<PathPart> {
        let tree = &self.model.articulations[self.model.articulations.len() - 1].tree;
        let part = |(JointAxis { link, index }, factor)| {
            let (_, own) = self.model.link_of(link).ok()?;
            let [coordinates, dofs] = tree.range(own);
            let (coordinate, dof) = (coordinates.start + index, dofs.start + index);
            Some(PathPart::Axis { coordinate, dof, factor })
        };
        match along {
            Along::Joints(axes) => axes.into_iter().filter_map(part).collect(),
            Along::Path(path) => path.0.clone(),
        }
    }

    /// The inertia along a length with all joints at their references: 1/(J M⁻¹ Jᵀ), everything else free to move.
    pub(super) fn inertia(&self, along: &Along) -> f64 {
        self.inertia_of(&self.length(along, &self.references[0]).1)
    }

    fn inertia_of(&self, slopes: &DMatrix<f64>) -> f64 {
        let moved = self.mobility.times(slopes);
        let mut mobility = slopes.dot(&moved);
        if !self.rotors.is_empty() {
            // By Woodbury's identity.
            let columns: Vec<_> = self.rotors.iter().map(|(_, own)| own.column(0)).collect();
            let rotors = DMatrix::from_columns(&columns);
            let mut within = rotors.transpose() * self.mobility.times(&rotors);
            for (k, (inertia, _)) in self.rotors.iter().enumerate() {
                within[(k, k)] += 1.0 / inertia;
            }
            let along = rotors.transpose() * moved;
            mobility -= within.lu().solve(&along).map_or(f64::NAN, |share| along.dot(&share));
        }
        if mobility == 0.0 { 0.0 } else { 1.0 / mobility }
    }

    /// Stiffness and damping of a joint, whose link this is.
    fn spring_and_damper(&self, joint: &Joint, link: usize) -> [f64; 2] {
        let Some([time, ratio]) = joint.spring_damper else {
            return [joint.stiffness, joint.damping];
        };
        let tree = &self.model.articulations[self.model.articulations.len() - 1].tree;
        let [_, dofs] = tree.range(link);
        let count = dofs.len() as f64;
        let mobility = dofs.map(|dof| {
            let unit = DMatrix::from_fn(tree.nv(), 1, |k, _| f64::from(k == dof));
            1.0 / self.inertia_of(&unit)
        });
        let inertia = count / mobility.sum::<f64>();
        [inertia / (time * ratio).powi(2), 2.0 * inertia / time]
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
        let [stiffness, damping] = self.spring_and_damper(joint, link);
        let rest = joint.spring_reference;
        if joint.higher_stiffness != [0.0; 2] {
            let law = polynomial(stiffness, joint.higher_stiffness, (rest, rest));
            self.add(&along, Arc::new(law))?;
        } else if stiffness > 0.0 {
            self.add(&along, Arc::new(JointSpring { stiffness, rest }))?;
        }
        self.add_losses(&along, (damping, joint.higher_damping), joint.friction_loss)?;
        if let Some((low, high)) = joint.actuator_force_range {
            let bound = (first, [low, high], joint.carries_by_actuator);
            self.model.transmissions.bounds.push(bound);
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
        let [stiffness, damping] = self.spring_and_damper(joint, link);
        let reference = match is_free {
            true => self.mjcf.bodies[index.body].t_parent_body,
            false => Isometry3::identity(),
        };
        let bends = joint.higher_stiffness != [0.0; 2];
        if bends && !is_free {
            let along = Along::Path(Arc::new(Path(vec![PathPart::Angle { link }])));
            let law = polynomial(stiffness, joint.higher_stiffness, (0.0, 0.0));
            self.add(&along, Arc::new(law))?;
        }
        for k in 0..joint.kind.velocities() {
            let mut gear = [0.0; 6];
            gear[k] = 1.0;
            let (in_parent, reference) = (false, Some(reference));
            let part = PathPart::Turn { link, gear, is_free, in_parent, reference };
            let along = Along::Path(Arc::new(Path(vec![part])));
            self.add_losses(&along, (damping, joint.higher_damping), joint.friction_loss)?;
            if stiffness > 0.0 && !bends {
                self.add(&along, Arc::new(JointSpring { stiffness, rest: 0.0 }))?;
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
            let law = PolynomialDamper { linear: damping, quadratic: b, cubic: c };
            self.add(along, Arc::new(law))?;
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
        let [stiffness, _] = stiffness(solver, self.inertia(along), 1.0);
        self.add(along, limits(range, stiffness)).map(|_| ())
    }

    fn add_tendon(&mut self, tendon: &Tendon) -> Result<(), MjcfError> {
        let along = self.lengths.of_tendon(tendon, 1.0);
        self.add_losses(&along, (tendon.damping, tendon.higher_damping), tendon.friction_loss)?;
        if tendon.stiffness > 0.0 || tendon.higher_stiffness != [0.0; 2] {
            let (lower, upper) = tendon.spring_range.unwrap_or_else(|| {
                let (length, _) = self.length(&along, &self.references[1]);
                (length, length)
            });
            let stiffness = tendon.stiffness;
            let law: Arc<dyn DynJointLaw> = match tendon.higher_stiffness == [0.0; 2] {
                true => Arc::new(SlackSpring { stiffness, lower, upper }),
                false => Arc::new(polynomial(stiffness, tendon.higher_stiffness, (lower, upper))),
            };
            self.add(&along, law)?;
        }
        if let Some(range) = tendon.range {
            self.add_limits(&along, range, &tendon.limit_solver)?;
        }
        Ok(())
    }

    /// Holds a length where a polynomial of another has it, both less what they are with all joints at their references.
    fn couple(
        &mut self,
        first: Along,
        second: Option<Along>,
        &[constant, slope, ref rest @ ..]: &[f64; 5],
        solver: &SolverParameters,
    ) -> Result<(), MjcfError> {
        let along = match (first, second) {
            (first, None) => first,
            (Along::Joints(mut axes), Some(Along::Joints(others))) if *rest == [0.0; 3] => {
                axes.extend(others.into_iter().map(|(axis, factor)| (axis, -slope * factor)));
                Along::Joints(axes)
            }
            (first, Some(second)) => {
                let (reference, _) = self.length(&second, &self.references[0]);
                let [b, c, d] = rest.map(|x| -x);
                let coefficients = [0.0, -slope, b, c, d];
                let path = Box::new(Path(self.parts(second)));
                let mut parts = self.parts(first);
                parts.push(PathPart::Polynomial { path, reference, coefficients });
                Along::Path(Arc::new(Path(parts)))
            }
        };
        let (reference, slopes) = self.length(&along, &self.references[0]);
        let [stiffness, damping] = stiffness(solver, self.inertia_of(&slopes), self.softness);
        self.add(&along, Arc::new(JointSpring { stiffness, rest: reference + constant }))?;
        self.add(&along, Arc::new(JointDamper { damping })).map(|_| ())
    }
}

fn polynomial(
    linear: f64,
    [quadratic, cubic]: [f64; 2],
    (lower, upper): (f64, f64),
) -> PolynomialSpring {
    PolynomialSpring { linear, quadratic, cubic, lower, upper }
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
