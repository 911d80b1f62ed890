//! Derivatives of the dynamics, in closed form.

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};

use prehend_autodiff::lie::cross_matrix;
use prehend_autodiff::{Fwd, Scalar};

use super::kinematics::Kinematics;
use super::tree_factor::TreeFactor;
use crate::spatial::{SpatialInertia, angular, cross_force, cross_motion, linear};

/// Derivatives of efforts τ: by displacements along unit velocities, and by velocities.
#[derive(Clone, Debug, PartialEq)]
pub struct DynamicsDerivatives {
    /// By positions: column k is the change of τ while coordinates [move](super::Articulation::moved) with the unit velocity k.
    pub by_position: DMatrix<f64>,
    /// By velocities.
    pub by_velocity: DMatrix<f64>,
    /// By accelerations: the [mass matrix](Kinematics::mass_matrix).
    pub by_acceleration: DMatrix<f64>,
}

/// Derivatives of accelerations v̇.
#[derive(Clone, Debug, PartialEq)]
pub struct ForwardDerivatives {
    /// By positions, as in [`DynamicsDerivatives`].
    pub by_position: DMatrix<f64>,
    /// By velocities.
    pub by_velocity: DMatrix<f64>,
    /// By efforts: the inverse of the mass matrix.
    pub by_effort: DMatrix<f64>,
}

impl Kinematics<'_> {
    /// Derivatives of [inverse dynamics](Self::inverse_dynamics) at accelerations v̇.
    ///
    /// Singh, Russell and Wensing, Efficient Analytical Derivatives of Rigid-Body Dynamics using Spatial Vector Algebra, 2022.
    ///
    /// # Panics
    /// If there is not one acceleration for each degree of freedom.
    pub fn inverse_dynamics_derivatives(&self, accelerations: &[f64]) -> DynamicsDerivatives {
        if let Some([q, v]) = &self.custom {
            return self.by_forward_mode(q, v, accelerations);
        }
        let effort = self.effort(accelerations);
        let (n, links) = (self.axes.len(), self.tree.links());
        // How axes change: with their parent's motion, and with their own link's.
        let mut with_parent = Vec::with_capacity(n);
        let mut twice = Vec::with_capacity(n);
        let mut with_both = Vec::with_capacity(n);
        for (dof, axis) in self.axes.iter().enumerate() {
            let link = self.tree.link_of(dof);
            let (velocity, acceleration) = match links[link].parent {
                Some(parent) => (self.velocities[parent], effort.accelerations[parent]),
                None => (Vector6::zeros(), self.rest()),
            };
            let change = cross_motion(&velocity, axis);
            with_parent.push(change);
            twice.push(cross_motion(&acceleration, axis) + cross_motion(&velocity, &change));
            with_both.push(change + cross_motion(&self.velocities[link], axis));
        }
        let composites = self.composites();
        let own = self.velocities.iter().zip(&self.inertias);
        let mut rates: Vec<Matrix6<f64>> = own.map(|(v, inertia)| rate(v, inertia)).collect();
        let [mut by_position, mut by_velocity, mut by_acceleration] =
            [(); 3].map(|()| DMatrix::zeros(n, n));
        for (index, link) in links.iter().enumerate().rev() {
            let (composite, rate) = (&composites[index], rates[index]);
            let [_, dofs] = self.tree.range(index);
            for dof in dofs {
                let axis = &self.axes[dof];
                let moved = rate * with_parent[dof]
                    + composite.times(&twice[dof])
                    + cross_force(axis, &effort.forces[index]);
                let pushed = rate * axis + composite.times(&with_both[dof]);
                let (by_rate, by_inertia) = (rate.tr_mul(axis), composite.times(axis));
                for other in self.tree.dofs_of(index) {
                    by_position[(dof, other)] =
                        by_rate.dot(&with_parent[other]) + by_inertia.dot(&twice[other]);
                    by_velocity[(dof, other)] =
                        by_rate.dot(&self.axes[other]) + by_inertia.dot(&with_both[other]);
                    let mass = by_inertia.dot(&self.axes[other]);
                    by_acceleration[(dof, other)] = mass;
                    by_acceleration[(other, dof)] = mass;
                    if self.tree.link_of(other) != index {
                        by_position[(other, dof)] = self.axes[other].dot(&moved);
                        by_velocity[(other, dof)] = self.axes[other].dot(&pushed);
                    }
                }
                by_acceleration[(dof, dof)] += link.armature;
            }
            if let Some(parent) = link.parent {
                rates[parent] += rate;
            }
        }
        DynamicsDerivatives { by_position, by_velocity, by_acceleration }
    }

    /// [`inverse_dynamics_derivatives`](Self::inverse_dynamics_derivatives) at coordinates `q` and velocities `v`, direction by direction.
    fn by_forward_mode(&self, q: &[f64], v: &[f64], accelerations: &[f64]) -> DynamicsDerivatives {
        let n = v.len();
        let lifted = self.tree.cast::<Fwd<1>>();
        let constants = |x: &[f64]| x.iter().map(|x| Fwd::constant(*x)).collect::<Vec<Fwd<1>>>();
        let [q, v, accelerations] = [q, v, accelerations].map(constants);
        let effort = |q: &[Fwd<1>], v: &[Fwd<1>]| {
            let at = lifted.kinematics(q, v).under(self.gravity.map(Fwd::constant));
            at.inverse_dynamics(&accelerations).map(|x| x.derivative[0])
        };
        let [mut by_position, mut by_velocity] = [(); 2].map(|()| DMatrix::zeros(n, n));
        for k in 0..n {
            let mut step = vec![Fwd::constant(0.0); n];
            step[k] = Fwd::variable(0.0, 0);
            by_position.set_column(k, &effort(&lifted.moved(&q, &step), &v));
            let pushed: Vec<Fwd<1>> = v.iter().zip(&step).map(|(v, step)| *v + *step).collect();
            by_velocity.set_column(k, &effort(&q, &pushed));
        }
        DynamicsDerivatives { by_position, by_velocity, by_acceleration: self.mass_matrix() }
    }

    /// Derivatives of [forward dynamics](Self::forward_dynamics), whose result is `accelerations`: those of inverse dynamics there,
    /// by the inverse of the mass matrix. `None` if that is singular.
    ///
    /// # Panics
    /// If there is not one acceleration for each degree of freedom.
    pub fn forward_dynamics_derivatives(
        &self,
        accelerations: &DVector<f64>,
    ) -> Option<ForwardDerivatives> {
        let DynamicsDerivatives { by_position, by_velocity, by_acceleration } =
            self.inverse_dynamics_derivatives(accelerations.as_slice());
        let factor = TreeFactor::new(&by_acceleration, self.tree.carriers())?;
        let n = self.axes.len();
        // Row by row: by positions, velocities and efforts.
        let mut all = DMatrix::zeros(3 * n, n);
        for (row, mut column) in all.column_iter_mut().enumerate() {
            for k in 0..n {
                column[k] = -by_position[(row, k)];
                column[n + k] = -by_velocity[(row, k)];
            }
            column[2 * n + row] = 1.0;
        }
        factor.solve_transposed(&mut all);
        let part = |k: usize| all.rows(k * n, n).transpose();
        Some(ForwardDerivatives { by_position: part(0), by_velocity: part(1), by_effort: part(2) })
    }
}

/// The matrix B of m ↦ v ×* (I m) − I (v × m) + m ×* (I v): how a body of inertia I that moves with v resists to a change of motion.
fn rate(v: &Vector6<f64>, inertia: &SpatialInertia<f64>) -> Matrix6<f64> {
    let momentum = inertia.times(v);
    let (force, torque) = (linear(&momentum), angular(&momentum));
    let spin = angular(v);
    // The inertia's own rate is that of a body about a moving point.
    let moment = inertia.moment;
    let moment_rate = linear(v) * inertia.mass + spin.cross(&moment);
    let turned = cross_matrix(&spin) * inertia.inertia;
    // −(v c̄ + c̄ v), c̄ the first moment.
    let velocity = linear(v);
    let carried = cross_matrix(&velocity) * cross_matrix(&moment);
    let inertia_rate = turned + turned.transpose() - carried - carried.transpose();
    let mut matrix = Matrix6::zeros();
    let change = cross_matrix(&moment_rate);
    let pull = cross_matrix(&force);
    matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-change - pull));
    matrix.fixed_view_mut::<3, 3>(3, 0).copy_from(&(change - pull));
    matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&(inertia_rate - cross_matrix(&torque)));
    matrix
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};

    use super::*;

    #[test]
    fn the_rate_is_that_of_its_definition() {
        let com = Vector3::new(0.1, -0.2, 0.3);
        let at_com = Matrix3::new(2.0, 0.1, 0.2, 0.1, 3.0, -0.1, 0.2, -0.1, 4.0);
        let inertia = SpatialInertia::new(1.5, &com, &at_com);
        let v = Vector6::new(1.0, 2.0, -1.0, 0.5, -0.4, 0.3);
        let matrix = rate(&v, &inertia);
        for k in 0..6 {
            let m = Vector6::ith(k, 1.0);
            let expected = cross_force(&v, &inertia.times(&m))
                - inertia.times(&cross_motion(&v, &m))
                + cross_force(&m, &inertia.times(&v));
            assert!((matrix * m - expected).amax() < 1e-13, "{k}");
        }
    }
}
