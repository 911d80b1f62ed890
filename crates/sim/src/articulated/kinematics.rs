//! Poses and velocities of links.

use nalgebra::{
    Isometry3, Matrix3, Matrix6xX, Point3, Rotation3, UnitQuaternion, Vector3, Vector6,
};
use prehend_autodiff::Scalar;

use super::joint::{CustomJoint, Joint};
use super::joint_model::CustomMotion;
use super::link::Articulation;
use crate::spatial::{SpatialInertia, angular, cross_motion, linear, spatial};

/// Positions, velocities and inertias of the links at some coordinates and velocities.
///
/// Spatial vectors are about an origin at rest near the first link, along the world's axes.
#[derive(Clone, Debug)]
pub struct Kinematics<'a, S: Scalar = f64> {
    pub(crate) tree: &'a Articulation<S>,
    /// That origin, in the world \[m\].
    pub(crate) origin: Vector3<f64>,
    /// Link → world, about the origin.
    pub(crate) rotations: Vec<Matrix3<S>>,
    pub(crate) places: Vec<Vector3<S>>,
    /// Motion of each degree of freedom.
    pub(crate) axes: Vec<Vector6<S>>,
    /// For each link, that of its joint alone, and with its parent's.
    pub(crate) joint_velocities: Vec<Vector6<S>>,
    pub(crate) velocities: Vec<Vector6<S>>,
    /// Acceleration of each link at constant velocities of the joints.
    pub(crate) drifts: Vec<Vector6<S>>,
    pub(crate) inertias: Vec<SpatialInertia<S>>,
    /// Acceleration of free fall \[m/s²\].
    pub(crate) gravity: Vector3<S>,
    /// Coordinates and velocities, where there are joint types of one's own.
    pub(crate) custom: Option<[Vec<S>; 2]>,
}

/// True if inertias are needed.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Scope {
    WithInertia,
    /// Positions and velocities alone.
    KinematicsOnly,
}

/// Energies \[J\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energy<S: Scalar = f64> {
    /// Kinetic energy, armature included.
    pub kinetic: S,
    /// Potential energy in the gravity field, zero at the world's origin.
    pub potential: S,
}

impl<'a, S: Scalar> Kinematics<'a, S> {
    pub(crate) fn new(tree: &'a Articulation<S>, q: &[S], v: &[S], scope: Scope) -> Self {
        tree.check(q, v);
        let count = tree.links().len();
        let mut at = Self {
            tree,
            origin: Vector3::zeros(),
            rotations: Vec::with_capacity(count),
            places: Vec::with_capacity(count),
            axes: Vec::with_capacity(v.len()),
            joint_velocities: Vec::with_capacity(count),
            velocities: Vec::with_capacity(count),
            drifts: Vec::with_capacity(count),
            inertias: Vec::with_capacity(count),
            gravity: *tree.gravity(),
            custom: None,
        };
        for (index, link) in tree.links().iter().enumerate() {
            let [coordinates, dofs] = tree.range(index);
            let own = match &link.joint {
                Joint::Custom(CustomJoint(model)) => {
                    Some(CustomMotion::new(model, &q[coordinates.clone()], &v[dofs.clone()]))
                }
                _ => None,
            };
            let (turned, moved) = match &own {
                Some(motion) => (Some(motion.rotation), Some(motion.place)),
                None => link.joint.placement(&q[coordinates]),
            };
            let joint_frame = link.joint_frame();
            let joint_rotation = joint_frame.rotation.to_rotation_matrix().into_inner();
            let joint_place = joint_frame.translation.vector;
            let (mut rotation, mut place) = match link.parent {
                Some(parent) => {
                    let of_parent = at.rotations[parent];
                    (of_parent * joint_rotation, at.places[parent] + of_parent * joint_place)
                }
                None => (joint_rotation, joint_place),
            };
            if let Some(moved) = moved {
                place += rotation * moved;
            }
            if let Some(turned) = turned {
                rotation *= turned;
            }
            if index == 0 {
                at.origin = place.map(S::value);
            }
            if link.parent.is_none() {
                place -= at.origin.map(S::constant);
            }
            let mut joint_velocity = Vector6::zeros();
            let along_world = |axis: &Vector6<S>| {
                let turn = rotation * angular(axis);
                spatial(&(rotation * linear(axis) + place.cross(&turn)), &turn)
            };
            for (k, dof) in dofs.enumerate() {
                let axis = match &own {
                    Some(motion) => along_world(&motion.axes[k]),
                    None => along_world(&link.joint.axis(k).map(S::constant)),
                };
                joint_velocity += axis * v[dof];
                at.axes.push(axis);
            }
            let of_parent = link.parent.map_or_else(Vector6::zeros, |p| at.velocities[p]);
            if scope == Scope::WithInertia {
                let com = place + rotation * link.com.coords;
                let inertia = rotation * link.inertia * rotation.transpose();
                at.inertias.push(SpatialInertia::new(link.mass, &com, &inertia));
            }
            at.rotations.push(rotation);
            at.places.push(place);
            let velocity = of_parent + joint_velocity;
            let mut drift = cross_motion(&velocity, &joint_velocity);
            if let Some(motion) = &own {
                drift += along_world(&motion.drift);
                at.custom.get_or_insert_with(|| [q.to_vec(), v.to_vec()]);
            }
            at.joint_velocities.push(joint_velocity);
            at.velocities.push(velocity);
            at.drifts.push(drift);
        }
        at
    }

    /// Under another acceleration of free fall \[m/s²\].
    #[must_use]
    pub fn under(self, gravity: Vector3<S>) -> Self {
        Self { gravity, ..self }
    }

    /// Link → world.
    ///
    /// # Panics
    /// If there is no such link.
    pub fn pose(&self, link: usize) -> Isometry3<S> {
        let rotation = Rotation3::from_matrix_unchecked(self.rotations[link]);
        let place = self.places[link] + self.origin.map(S::constant);
        Isometry3::from_parts(place.into(), UnitQuaternion::from_rotation_matrix(&rotation))
    }

    /// Velocity \[m/s\] of a point of `link`, given in its frame \[m\], and the link's angular velocity \[rad/s\], along the world's axes.
    ///
    /// # Panics
    /// If there is no such link.
    pub fn velocity(&self, link: usize, point: &Point3<S>) -> [Vector3<S>; 2] {
        let arm = self.places[link] + self.rotations[link] * point.coords;
        let (velocity, spin) = (linear(&self.velocities[link]), angular(&self.velocities[link]));
        [velocity + spin.cross(&arm), spin]
    }

    /// Derivatives of [`velocity`](Self::velocity), the point's and then the angular, by all velocities.
    ///
    /// # Panics
    /// If there is no such link.
    pub fn jacobian(&self, link: usize, point: &Point3<S>) -> Matrix6xX<S> {
        let arm = self.places[link] + self.rotations[link] * point.coords;
        let mut jacobian = Matrix6xX::zeros(self.axes.len());
        for dof in self.tree.dofs_of(link) {
            let (velocity, spin) = (linear(&self.axes[dof]), angular(&self.axes[dof]));
            jacobian.set_column(dof, &spatial(&(velocity + spin.cross(&arm)), &spin));
        }
        jacobian
    }

    /// A force and torque about a link's origin, about the origin of all.
    #[inline]
    pub(crate) fn about_origin(&self, link: usize, wrench: &Vector6<S>) -> Vector6<S> {
        let force = linear(wrench);
        spatial(&force, &(angular(wrench) + self.places[link].cross(&force)))
    }

    /// Linear momentum \[kg m/s\] and angular momentum about the world's origin \[kg m²/s\] of all links, without armature.
    pub fn momentum(&self) -> Vector6<S> {
        let links = self.inertias.iter().zip(&self.velocities);
        let sum = links.fold(Vector6::zeros(), |sum, (inertia, v)| sum + inertia.times(v));
        let along = linear(&sum);
        spatial(&along, &(angular(&sum) + self.origin.map(S::constant).cross(&along)))
    }

    /// Kinetic and potential energy.
    pub fn energy(&self, v: &[S]) -> Energy<S> {
        let (mut kinetic, mut potential) = (S::zero(), S::zero());
        for (index, link) in self.tree.links().iter().enumerate() {
            let (velocity, inertia) = (&self.velocities[index], &self.inertias[index]);
            kinetic += velocity.dot(&inertia.times(velocity));
            let [_, dofs] = self.tree.range(index);
            v[dofs].iter().for_each(|v| kinetic += link.armature * *v * *v);
            let moment = inertia.moment + self.origin.map(S::constant) * link.mass;
            potential -= self.gravity.dot(&moment);
        }
        Energy { kinetic: kinetic.times(0.5), potential }
    }
}
