//! The composite rigid body algorithm.

use nalgebra::DMatrix;
use prehend_autodiff::Scalar;

use super::kinematics::Kinematics;
use super::spatial::SpatialInertia;

impl<S: Scalar> Kinematics<'_, S> {
    /// M, by which accelerations cause efforts: symmetric, positive definite where every degree of freedom moves mass or has armature.
    pub fn mass_matrix(&self) -> DMatrix<S> {
        let composites = self.composites();
        let mut matrix = DMatrix::zeros(self.axes.len(), self.axes.len());
        for (index, link) in self.tree.links().iter().enumerate() {
            let [_, freedoms] = self.tree.range(index);
            for freedom in freedoms {
                let force = composites[index].times(&self.axes[freedom]);
                for other in self.tree.freedoms_of(index) {
                    let entry = self.axes[other].dot(&force);
                    matrix[(other, freedom)] = entry;
                    matrix[(freedom, other)] = entry;
                }
                matrix[(freedom, freedom)] += link.armature;
            }
        }
        matrix
    }

    /// Inertia of each link with all that hangs on it.
    pub(super) fn composites(&self) -> Vec<SpatialInertia<S>> {
        let mut composites = self.inertias.clone();
        for (index, link) in self.tree.links().iter().enumerate().rev() {
            if let Some(parent) = link.parent {
                let of_link = composites[index];
                composites[parent] += &of_link;
            }
        }
        composites
    }
}
