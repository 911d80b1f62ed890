//! Effects of a robot's transmissions beyond forces along single joints: bounds on what actuators do together, inertia that moves with a
//! length, weight that is carried, and inputs with a state of their own.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Vector6};
use prehend_autodiff::Scalar;

use super::Model;
use super::joint_force::{JointAxis, JointForce};
use super::path::Path;
use crate::articulated::Kinematics;
use crate::articulated::adjoint::{Acting, accelerations};
use crate::body_state::Rows;
use crate::handle::BodyId;
use crate::handle::JointForceId;
use crate::joint_law::dynamic::DynJointLaw;
use crate::model::articulated_body::ArticulatedBody;
use crate::spatial::spatial;

/// Transmissions of the robots of a model.
#[derive(Clone, Debug, Default)]
pub struct Transmissions {
    /// Smallest and largest sum of what actuators do along an axis, and whether carried weight counts among it.
    pub(crate) bounds: Vec<(JointAxis, [f64; 2], bool)>,
    pub(crate) rotors: Vec<Rotor>,
    /// The share of the weight of links that is carried for them.
    pub(crate) carried: Vec<(BodyId, f64)>,
    /// Joints that mimic others.
    pub(crate) couplings: Vec<Coupling>,
}

/// A joint that follows another one: q = `slope` q_leader + `offset`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Coupling {
    pub(crate) follower: JointAxis,
    pub(crate) leader: JointAxis,
    pub(crate) slope: f64,
    pub(crate) offset: f64,
}

/// Inertia that moves with a sum of joints and a path.
#[derive(Clone, Debug)]
pub(crate) struct Rotor {
    /// A link of its articulation.
    pub(crate) link: BodyId,
    pub(crate) axes: Vec<(JointAxis, f64)>,
    pub(crate) path: Option<Arc<Path>>,
    pub(crate) inertia: f64,
}

impl Transmissions {
    /// True if they act on nothing.
    pub(crate) fn is_empty(&self) -> bool {
        self.bounds.is_empty() && self.rotors.is_empty() && self.carried.is_empty()
    }

    /// Those of the bodies that `has`, as other bodies.
    pub(crate) fn with_bodies(
        &self,
        has: impl Fn(BodyId) -> bool,
        body: impl Fn(BodyId) -> BodyId,
    ) -> Self {
        let axis = |axis: JointAxis| JointAxis { link: body(axis.link), ..axis };
        let bounds = self.bounds.iter().filter(|(axis, ..)| has(axis.link));
        let rotors = self.rotors.iter().filter(|rotor| has(rotor.link)).map(|rotor| Rotor {
            link: body(rotor.link),
            axes: rotor.axes.iter().map(|(own, factor)| (axis(*own), *factor)).collect(),
            ..rotor.clone()
        });
        let carried = self.carried.iter().filter(|(link, _)| has(*link));
        Self {
            bounds: bounds.map(|(own, range, counts)| (axis(*own), *range, *counts)).collect(),
            rotors: rotors.collect(),
            carried: carried.map(|(link, share)| (body(*link), *share)).collect(),
            // For setting joints, which nobody does there.
            couplings: Vec::new(),
        }
    }
}

impl Model {
    /// Lets `law` act along a path through the articulation of `link`.
    pub(crate) fn add_path_force(
        &mut self,
        link: BodyId,
        path: Arc<Path>,
        law: Arc<dyn DynJointLaw>,
    ) -> Result<JointForceId, crate::error::BuildError> {
        let mut force = JointForce::new(vec![(link.into(), 0.0)], law);
        force.path = Some(path);
        self.check_joint_force(&force)?;
        self.joint_forces.push(force);
        Ok(JointForceId(self.joint_forces.len() - 1))
    }
}

impl<S: Scalar> Model<S> {
    /// The axes, as one of those of its articulation each, along which actuators are bounded, with their bounds.
    pub(super) fn bounded(&self) -> impl Iterator<Item = (usize, usize, [f64; 2], bool)> {
        self.transmissions.bounds.iter().filter_map(|(axis, range, counts)| {
            let (articulation, link) = self.link_of(axis.link).ok()?;
            let [_, dofs] = self.articulations[articulation].tree.range(link);
            Some((articulation, dofs.start + axis.index, *range, *counts))
        })
    }

    /// Adds what carries weight to the efforts of an articulation.
    pub(super) fn add_carried(
        &self,
        own: &ArticulatedBody<S>,
        at: &Kinematics<'_, S>,
        efforts: &mut [S],
    ) {
        for (body, share) in &self.transmissions.carried {
            let Some(link) = own.bodies().iter().position(|own| own == body) else { continue };
            let Some(inertia) = at.inertias.get(link) else { continue };
            let weight = self.gravity * inertia.mass.times(-*share);
            let moment = (inertia.moment).cross(&(self.gravity * S::constant(-*share)));
            let wrench: Vector6<S> = spatial(&weight, &moment);
            for dof in own.tree.dofs_of(link) {
                efforts[dof] += at.axes[dof].dot(&wrench);
            }
        }
    }

    /// For each rotor of an articulation its inertia, the derivatives of its length by each degree of freedom, and its drift.
    fn rotors(
        &self,
        own: &ArticulatedBody<S>,
        at: &Kinematics<'_, S>,
        joints: &Rows<S>,
        q: &[S],
    ) -> Vec<(f64, DVector<S>, S)> {
        let rotors = self.transmissions.rotors.iter();
        let own_rotors = rotors.filter(|rotor| own.bodies().contains(&rotor.link));
        let slopes = own_rotors.map(|rotor| {
            let mut slopes = DVector::zeros(own.tree.nv());
            let mut drift = S::zero();
            for (axis, factor) in &rotor.axes {
                let link = own.bodies().iter().position(|body| *body == axis.link);
                let Some(link) = link else { continue };
                let joint = &own.tree.links()[link].joint;
                let [_, dofs] = own.tree.range(link);
                for (dof, slope) in dofs.zip(joint.position_slopes(&joints[link], axis.index)) {
                    slopes[dof] += slope.times(*factor);
                }
            }
            if let Some(path) = &rotor.path {
                let length = path.length(at, q, true);
                slopes += DVector::from_vec(length.slopes);
                drift = length.drift;
            }
            (rotor.inertia, slopes, drift)
        });
        slopes.collect()
    }

    /// The mass matrix of an articulation, with what moves with lengths: accelerations of its joints cause efforts by it.
    pub(crate) fn mass_matrix_of(&self, articulation: usize, states: &Rows<S>) -> DMatrix<S> {
        let own = &self.articulations[articulation];
        let joints = &states[self.joint_range(articulation)];
        let [q, v] = own.coordinates(joints);
        let at = own.tree.kinematics(&q, &v);
        let mut mass = at.mass_matrix();
        for (inertia, slopes, _) in self.rotors(own, &at, joints, &q) {
            mass += &slopes * slopes.transpose() * S::constant(inertia);
        }
        mass
    }

    /// Accelerations of the joints of an articulation. Rotors are a change of the mass matrix of low rank (Woodbury).
    pub(super) fn accelerated(
        &self,
        own: &ArticulatedBody<S>,
        joints: &Rows<S>,
        [coordinates, velocities]: [&[S]; 2],
        efforts: &[S],
        wrenches: &[Vector6<S>],
    ) -> DVector<S> {
        let gravity = self.gravity;
        let acting = Acting { gravity, coordinates, velocities, efforts, wrenches };
        if !self.transmissions.rotors.iter().any(|rotor| own.bodies().contains(&rotor.link)) {
            return accelerations(&own.tree, &acting);
        }
        let at = own.tree.kinematics(coordinates, velocities);
        let rotors = self.rotors(own, &at, joints, coordinates);
        let mut efforts = DVector::from_column_slice(efforts);
        for (inertia, slopes, drift) in &rotors {
            efforts -= slopes * drift.times(*inertia);
        }
        let plain = accelerations(&own.tree, &Acting { efforts: efforts.as_slice(), ..acting });
        let rest = vec![S::zero(); velocities.len()];
        let nothing = vec![Vector6::zeros(); wrenches.len()];
        let moved: Vec<DVector<S>> = rotors
            .iter()
            .map(|(_, slopes, _)| {
                let acting = Acting {
                    gravity: nalgebra::Vector3::zeros(),
                    coordinates,
                    velocities: &rest,
                    efforts: slopes.as_slice(),
                    wrenches: &nothing,
                };
                accelerations(&own.tree, &acting)
            })
            .collect();
        let n = rotors.len();
        let mut small = DMatrix::from_fn(n, n, |i, j| rotors[i].1.dot(&moved[j]));
        for (k, (inertia, _, _)) in rotors.iter().enumerate() {
            small[(k, k)] += S::constant(1.0 / inertia);
        }
        let along = DVector::from_fn(n, |k, _| rotors[k].1.dot(&plain));
        let Some(share) = small.lu().solve(&along) else {
            return plain.map(|_| S::constant(f64::NAN));
        };
        let mut all = plain;
        moved.iter().zip(share.iter()).for_each(|(moved, share)| all -= moved * *share);
        all
    }
}
