//! The composite rigid body algorithm.

use nalgebra::{DMatrix, Vector3};
use prehend_autodiff::Scalar;

use super::kinematics::Kinematics;
use crate::spatial::SpatialInertia;

impl<S: Scalar> Kinematics<'_, S> {
    /// M, by which accelerations cause efforts: symmetric, positive definite where every degree of freedom moves mass or has armature.
    pub fn mass_matrix(&self) -> DMatrix<S> {
        let composites = self.composites();
        let mut matrix = DMatrix::zeros(self.axes.len(), self.axes.len());
        for (index, link) in self.tree.links().iter().enumerate() {
            let [_, dofs] = self.tree.range(index);
            for dof in dofs {
                let force = composites[index].times(&self.axes[dof]);
                for other in self.tree.dofs_of(index) {
                    let entry = self.axes[other].dot(&force);
                    matrix[(other, dof)] = entry;
                    matrix[(dof, other)] = entry;
                }
                matrix[(dof, dof)] += link.armature;
            }
        }
        matrix
    }

    /// W of M⁻¹ = W Wᵀ, by values; no numbers if M is not positive definite.
    pub(crate) fn inverse_mass_root(&self) -> DMatrix<f64> {
        let mass = self.mass_matrix().map(S::value);
        let n = mass.nrows();
        let factor = mass.cholesky().and_then(|factor| factor.l().try_inverse());
        factor.map_or(DMatrix::from_element(n, n, f64::NAN), |inverse| inverse.transpose())
    }

    /// M⁻¹, by values; no numbers if M is not positive definite.
    pub(crate) fn inverse_mass_matrix(&self) -> DMatrix<f64> {
        let root = self.inverse_mass_root();
        &root * root.transpose()
    }

    /// For each link the radius of gyration, about the link's origin, of it and all that hangs on it \[m\]: no number where that has no mass.
    pub(crate) fn radii(&self) -> Vec<f64> {
        let radius = |(composite, place): (SpatialInertia<S>, &Vector3<S>)| {
            let (mass, moment) = (composite.mass.value(), composite.moment.map(S::value));
            let place = place.map(S::value);
            // Σ m |r − p|² = tr I / 2 − 2 p·Σ m r + M |p|².
            let about = 0.5 * composite.inertia.trace().value() - 2.0 * place.dot(&moment)
                + mass * place.norm_squared();
            (about / mass).sqrt()
        };
        self.composites().into_iter().zip(&self.places).map(radius).collect()
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
