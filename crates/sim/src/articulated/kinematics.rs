//! Where links are, and how they move.

use nalgebra::{
    Isometry3, Matrix3, Matrix6xX, Point3, Rotation3, UnitQuaternion, Vector3, Vector6,
};
use prehend_autodiff::Scalar;

use super::link::Articulation;
use super::spatial::{SpatialInertia, angular, linear, spatial};

/// Positions, velocities and inertias of the links at some coordinates and velocities.
///
/// Spatial vectors are about an origin at rest near the first link, along the world's axes.
#[derive(Clone, Debug)]
pub struct Kinematics<'a, S: Scalar = f64> {
    pub(super) tree: &'a Articulation<S>,
    /// That origin, in the world \[m\].
    origin: Vector3<f64>,
    /// Link → world, about the origin.
    pub(super) rotations: Vec<Matrix3<S>>,
    pub(super) places: Vec<Vector3<S>>,
    /// Motion of each degree of freedom.
    pub(super) axes: Vec<Vector6<S>>,
    /// Of each link, that of its joint alone, and with its parent's.
    pub(super) joint_velocities: Vec<Vector6<S>>,
    pub(super) velocities: Vec<Vector6<S>>,
    pub(super) inertias: Vec<SpatialInertia<S>>,
}

/// Energies \[J\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energy<S: Scalar = f64> {
    /// Of motion, armature included.
    pub kinetic: S,
    /// In the gravity field, zero where the world's origin is.
    pub potential: S,
}

impl<'a, S: Scalar> Kinematics<'a, S> {
    pub(super) fn new(tree: &'a Articulation<S>, q: &[S], v: &[S]) -> Self {
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
            inertias: Vec::with_capacity(count),
        };
        for (index, link) in tree.links().iter().enumerate() {
            let [coordinates, freedoms] = tree.range(index);
            let (turned, moved) = link.joint.placement(&q[coordinates]);
            let joint_rotation = link.t_parent_joint.rotation.to_rotation_matrix().into_inner();
            let joint_place = link.t_parent_joint.translation.vector;
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
            for (k, freedom) in freedoms.enumerate() {
                let axis = link.joint.axis(k).map(S::constant);
                let turn = rotation * angular(&axis);
                let axis = spatial(&(rotation * linear(&axis) + place.cross(&turn)), &turn);
                joint_velocity += axis * v[freedom];
                at.axes.push(axis);
            }
            let of_parent = link.parent.map_or_else(Vector6::zeros, |p| at.velocities[p]);
            let com = place + rotation * link.com.coords;
            let inertia = rotation * link.inertia * rotation.transpose();
            at.inertias.push(SpatialInertia::new(link.mass, &com, &inertia));
            at.rotations.push(rotation);
            at.places.push(place);
            at.joint_velocities.push(joint_velocity);
            at.velocities.push(of_parent + joint_velocity);
        }
        at
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
        for freedom in self.tree.freedoms_of(link) {
            let (velocity, spin) = (linear(&self.axes[freedom]), angular(&self.axes[freedom]));
            jacobian.set_column(freedom, &spatial(&(velocity + spin.cross(&arm)), &spin));
        }
        jacobian
    }

    /// Kinetic and potential energy.
    pub fn energy(&self, v: &[S]) -> Energy<S> {
        let gravity = self.tree.gravity().map(S::constant);
        let (mut kinetic, mut potential) = (S::zero(), S::zero());
        for (index, link) in self.tree.links().iter().enumerate() {
            let (velocity, inertia) = (&self.velocities[index], &self.inertias[index]);
            kinetic += velocity.dot(&inertia.times(velocity));
            let [_, freedoms] = self.tree.range(index);
            v[freedoms].iter().for_each(|v| kinetic += link.armature * *v * *v);
            let moment = inertia.moment + self.origin.map(S::constant) * link.mass;
            potential -= gravity.dot(&moment);
        }
        Energy { kinetic: kinetic.times(0.5), potential }
    }
}
