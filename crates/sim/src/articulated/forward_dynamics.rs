//! The articulated body algorithm.

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};
use prehend_autodiff::Scalar;

use super::kinematics::Kinematics;
use super::spatial::{cross_force, cross_motion};

impl<S: Scalar> Kinematics<'_, S> {
    /// Accelerations v̇ by efforts τ \[N m or N\]; not finite where a degree of freedom moves no mass.
    ///
    /// # Panics
    /// If there is not one for each degree of freedom.
    pub fn forward_dynamics(&self, efforts: &[S]) -> DVector<S> {
        let n = self.axes.len();
        assert_eq!(efforts.len(), n, "one number a degree of freedom");
        let links = self.tree.links();
        let mut inertias: Vec<Matrix6<S>> = self.inertias.iter().map(|i| i.matrix()).collect();
        let mut biases: Vec<Vector6<S>> = Vec::with_capacity(links.len());
        for (velocity, inertia) in self.velocities.iter().zip(&self.inertias) {
            biases.push(cross_force(velocity, &inertia.times(velocity)));
        }
        let drift =
            |index: usize| cross_motion(&self.velocities[index], &self.joint_velocities[index]);
        // Of each degree of freedom: the force of its acceleration, and of a joint the inverse of what efforts it takes.
        let mut pulls = vec![Vector6::zeros(); n];
        let mut rest = vec![S::zero(); n];
        let mut inverses: Vec<DMatrix<S>> = vec![DMatrix::zeros(0, 0); links.len()];
        for (index, link) in links.iter().enumerate().rev() {
            let [_, freedoms] = self.tree.range(index);
            let (inertia, bias) = (inertias[index], biases[index]);
            for freedom in freedoms.clone() {
                pulls[freedom] = inertia * self.axes[freedom];
                rest[freedom] = efforts[freedom] - self.axes[freedom].dot(&bias);
            }
            let (first, count) = (freedoms.start, freedoms.len());
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
                biases[parent] += pull + left * drift(index);
                inertias[parent] += left;
            }
        }
        let mut accelerations: Vec<Vector6<S>> = Vec::with_capacity(links.len());
        let mut result = DVector::zeros(n);
        for (index, link) in links.iter().enumerate() {
            let of_parent = link.parent.map_or_else(|| self.rest(), |p| accelerations[p]);
            let mut acceleration = of_parent + drift(index);
            let [_, freedoms] = self.tree.range(index);
            let first = freedoms.start;
            let left: Vec<S> =
                freedoms.clone().map(|f| rest[f] - pulls[f].dot(&acceleration)).collect();
            for freedom in freedoms {
                let inverse = inverses[index].row(freedom - first);
                let value = inverse.iter().zip(&left).fold(S::zero(), |sum, (i, l)| sum + *i * *l);
                acceleration += self.axes[freedom] * value;
                result[freedom] = value;
            }
            accelerations.push(acceleration);
        }
        result
    }
}
