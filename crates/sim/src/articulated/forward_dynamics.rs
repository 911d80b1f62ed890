//! The articulated body algorithm.

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};
use prehend_autodiff::Scalar;

use super::kinematics::Kinematics;
use crate::spatial::cross_force;

/// Factor of the mass matrix, which is left of the algorithm when accelerations are known.
pub(super) struct ArticulatedInertia<S: Scalar> {
    /// For each degree of freedom, the force of its acceleration on what hangs on it.
    pulls: Vec<Vector6<S>>,
    /// For each link, the inverse of the efforts that accelerations of its joint take.
    inverses: Vec<DMatrix<S>>,
}

impl<S: Scalar> Kinematics<'_, S> {
    /// Accelerations v̇ by efforts τ \[N m or N\]; not finite where a degree of freedom moves no mass.
    ///
    /// # Panics
    /// If there is not one for each degree of freedom.
    pub fn forward_dynamics(&self, efforts: &[S]) -> DVector<S> {
        self.articulated(efforts, None).0
    }

    /// [`forward_dynamics`](Self::forward_dynamics) with `wrenches` on the links: forces \[N\] and torques about the links' origins
    /// \[N m\], along the world's axes.
    ///
    /// # Panics
    /// If there is not one effort for each degree of freedom and one wrench for each link.
    pub fn forward_dynamics_under(&self, efforts: &[S], wrenches: &[Vector6<S>]) -> DVector<S> {
        self.articulated(efforts, Some(wrenches)).0
    }

    /// Accelerations, and the inertias that they follow from.
    pub(super) fn articulated(
        &self,
        efforts: &[S],
        wrenches: Option<&[Vector6<S>]>,
    ) -> (DVector<S>, ArticulatedInertia<S>) {
        let n = self.axes.len();
        assert_eq!(efforts.len(), n, "one number a degree of freedom");
        let links = self.tree.links();
        let mut inertias: Vec<Matrix6<S>> = self.inertias.iter().map(|i| i.matrix()).collect();
        let mut biases: Vec<Vector6<S>> = Vec::with_capacity(links.len());
        for (velocity, inertia) in self.velocities.iter().zip(&self.inertias) {
            biases.push(cross_force(velocity, &inertia.times(velocity)));
        }
        if let Some(wrenches) = wrenches {
            assert_eq!(wrenches.len(), links.len(), "one wrench a link");
            for (index, (bias, wrench)) in biases.iter_mut().zip(wrenches).enumerate() {
                *bias -= self.about_origin(index, wrench);
            }
        }
        let mut pulls = vec![Vector6::zeros(); n];
        let mut rest = vec![S::zero(); n];
        let mut inverses: Vec<DMatrix<S>> = vec![DMatrix::zeros(0, 0); links.len()];
        for (index, link) in links.iter().enumerate().rev() {
            let [_, dofs] = self.tree.range(index);
            let (inertia, bias) = (inertias[index], biases[index]);
            for dof in dofs.clone() {
                pulls[dof] = inertia * self.axes[dof];
                rest[dof] = efforts[dof] - self.axes[dof].dot(&bias);
            }
            let (first, count) = (dofs.start, dofs.len());
            let (mut left, mut pull) = (inertia, bias);
            if count == 1 {
                let axis = &self.axes[first];
                let inverse = S::one() / (axis.dot(&pulls[first]) + link.armature);
                inverses[index] = DMatrix::from_element(1, 1, inverse);
                let scaled = pulls[first] * inverse;
                left.ger(-S::one(), &scaled, &pulls[first], S::one());
                pull += scaled * rest[first];
            } else if count > 1 {
                let mut effort = DMatrix::from_fn(count, count, |r, c| {
                    self.axes[first + r].dot(&pulls[first + c])
                });
                (0..count).for_each(|k| effort[(k, k)] += link.armature);
                let nothing = DMatrix::from_element(count, count, S::constant(f64::NAN));
                let inverse = effort.cholesky().map_or(nothing, |factor| factor.inverse());
                for r in 0..count {
                    let mut scaled = Vector6::zeros();
                    for c in 0..count {
                        scaled += pulls[first + c] * inverse[(c, r)];
                    }
                    left.ger(-S::one(), &scaled, &pulls[first + r], S::one());
                    pull += scaled * rest[first + r];
                }
                inverses[index] = inverse;
            }
            if let Some(parent) = link.parent {
                biases[parent] += pull + left * self.drifts[index];
                inertias[parent] += left;
            }
        }
        let factor = ArticulatedInertia { pulls, inverses };
        let result = self.outward(&factor, &rest, self.rest(), |index| self.drifts[index]);
        (result, factor)
    }

    /// M⁻¹ `efforts`, as accelerations from rest without gravity.
    pub(super) fn accelerated(&self, factor: &ArticulatedInertia<S>, efforts: &[S]) -> DVector<S> {
        let mut rest = efforts.to_vec();
        let mut forces = vec![Vector6::zeros(); self.tree.links().len()];
        for (index, link) in self.tree.links().iter().enumerate().rev() {
            let [_, dofs] = self.tree.range(index);
            let mut force: Vector6<S> = forces[index];
            for dof in dofs.clone() {
                rest[dof] -= self.axes[dof].dot(&forces[index]);
            }
            let Some(parent) = link.parent else { continue };
            for r in dofs.clone() {
                let inverse = factor.inverses[index].row(r - dofs.start);
                let pushed = inverse.iter().zip(&rest[dofs.clone()]);
                let value = pushed.fold(S::zero(), |sum, (i, rest)| sum + *i * *rest);
                force += factor.pulls[r] * value;
            }
            forces[parent] += force;
        }
        self.outward(factor, &rest, Vector6::zeros(), |_| Vector6::zeros())
    }

    /// Accelerations of the joints, from the root outward, by what `rest`s of the efforts.
    fn outward(
        &self,
        factor: &ArticulatedInertia<S>,
        rest: &[S],
        root: Vector6<S>,
        drift: impl Fn(usize) -> Vector6<S>,
    ) -> DVector<S> {
        let links = self.tree.links();
        let mut accelerations: Vec<Vector6<S>> = Vec::with_capacity(links.len());
        let mut result = DVector::zeros(rest.len());
        for (index, link) in links.iter().enumerate() {
            let of_parent = link.parent.map_or(root, |p| accelerations[p]);
            let mut acceleration = of_parent + drift(index);
            let [_, dofs] = self.tree.range(index);
            let first = dofs.start;
            let inverse = &factor.inverses[index];
            if dofs.len() == 1 {
                let value = inverse[0] * (rest[first] - factor.pulls[first].dot(&acceleration));
                acceleration += self.axes[first] * value;
                result[first] = value;
            } else {
                let left: Vec<S> =
                    dofs.clone().map(|f| rest[f] - factor.pulls[f].dot(&acceleration)).collect();
                for dof in dofs {
                    let inverse = inverse.row(dof - first);
                    let terms = inverse.iter().zip(&left);
                    let value = terms.fold(S::zero(), |sum, (i, l)| sum + *i * *l);
                    acceleration += self.axes[dof] * value;
                    result[dof] = value;
                }
            }
            accelerations.push(acceleration);
        }
        result
    }
}
