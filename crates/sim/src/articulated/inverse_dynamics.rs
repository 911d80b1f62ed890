//! Recursive Newton–Euler.

use nalgebra::{DVector, Point3, Vector3, Vector6};
use prehend_autodiff::Scalar;

use super::kinematics::Kinematics;
use crate::spatial::{angular, cross_force, linear, spatial};

/// Motion and force of all links at some accelerations.
pub(super) struct Effort<S: Scalar> {
    /// Spatial acceleration of each link, less that of free fall.
    pub(super) accelerations: Vec<Vector6<S>>,
    /// Force on each link and all that hangs on it.
    pub(super) forces: Vec<Vector6<S>>,
}

impl<S: Scalar> Kinematics<'_, S> {
    /// Efforts τ \[N m or N\] of the joints at accelerations v̇.
    ///
    /// # Panics
    /// If there is not one for each degree of freedom.
    pub fn inverse_dynamics(&self, accelerations: &[S]) -> DVector<S> {
        let effort = self.effort(accelerations);
        let tau = |dof: usize| {
            let link = self.tree.link_of(dof);
            let armature = self.tree.links()[link].armature;
            self.axes[dof].dot(&effort.forces[link]) + armature * accelerations[dof]
        };
        DVector::from_fn(self.axes.len(), |dof, _| tau(dof))
    }

    /// Acceleration of a link's origin \[m/s²\], less that of free fall, and its angular acceleration \[rad/s²\], along the world's axes, at
    /// accelerations v̇.
    ///
    /// # Panics
    /// If there is not one for each degree of freedom, or no such link.
    pub fn acceleration(&self, link: usize, accelerations: &[S]) -> Vector6<S> {
        let at = self.effort(accelerations).accelerations[link];
        let [velocity, spin] = self.velocity(link, &Point3::origin());
        let turning = angular(&at);
        let origin = linear(&at) + turning.cross(&self.places[link]) + spin.cross(&velocity);
        spatial(&origin, &turning)
    }

    pub(super) fn effort(&self, accelerations: &[S]) -> Effort<S> {
        assert_eq!(accelerations.len(), self.axes.len(), "one number a degree of freedom");
        let links = self.tree.links();
        let mut effort = Effort {
            accelerations: Vec::with_capacity(links.len()),
            forces: Vec::with_capacity(links.len()),
        };
        for (index, link) in links.iter().enumerate() {
            let velocity = &self.velocities[index];
            let mut acceleration = match link.parent {
                Some(parent) => effort.accelerations[parent],
                None => self.rest(),
            };
            acceleration += self.drifts[index];
            let [_, dofs] = self.tree.range(index);
            for dof in dofs {
                acceleration += self.axes[dof] * accelerations[dof];
            }
            let inertia = &self.inertias[index];
            let force =
                inertia.times(&acceleration) + cross_force(velocity, &inertia.times(velocity));
            effort.accelerations.push(acceleration);
            effort.forces.push(force);
        }
        for (index, link) in links.iter().enumerate().rev() {
            if let Some(parent) = link.parent {
                let force = effort.forces[index];
                effort.forces[parent] += force;
            }
        }
        effort
    }

    /// Acceleration of the world, less that of free fall.
    pub(super) fn rest(&self) -> Vector6<S> {
        spatial(&-self.gravity, &Vector3::zeros())
    }
}
