//! What constraints of a robot have to move.

use nalgebra::{DMatrix, DVector};

use crate::world::World;
use crate::world::joint_force::JointAxis;

impl World {
    /// The inertia along a sum of joints of the last articulation, whose mass matrix has this inverse.
    pub(super) fn inertia_along(&self, inverse: &DMatrix<f64>, axes: &[(JointAxis, f64)]) -> f64 {
        let mut along = DVector::zeros(inverse.nrows());
        for (JointAxis { link, index }, factor) in axes {
            if let Ok((articulation, own)) = self.link_of(*link) {
                let [_, freedoms] = self.articulations[articulation].tree.range(own);
                along[freedoms.start + index] += factor;
            }
        }
        1.0 / along.dot(&(inverse * &along))
    }

    /// The inverse of the last articulation's mass matrix, with its joints at their neutral coordinates.
    pub(super) fn inverse_mass(&self) -> DMatrix<f64> {
        let tree = &self.articulations[self.articulations.len() - 1].tree;
        let rest = vec![0.0; tree.freedoms()];
        let root = tree.kinematics(&tree.neutral(), &rest).inverse_mass_root();
        &root * root.transpose()
    }
}
