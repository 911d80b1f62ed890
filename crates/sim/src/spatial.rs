//! Spatial vectors and inertias (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 2), all in one frame that does not move.
//!
//! A motion is the velocity of the body's point at the frame's origin and its angular velocity; a force is the force and its moment
//! about that origin. Both are ordered (linear, angular), as twists are everywhere here.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use prehend_autodiff::Scalar;
use prehend_autodiff::lie::cross_matrix;

/// (linear, angular).
#[inline]
pub(crate) fn spatial<S: Scalar>(linear: &Vector3<S>, angular: &Vector3<S>) -> Vector6<S> {
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}

#[inline]
pub(crate) fn linear<S: Scalar>(vector: &Vector6<S>) -> Vector3<S> {
    vector.fixed_rows::<3>(0).into_owned()
}

#[inline]
pub(crate) fn angular<S: Scalar>(vector: &Vector6<S>) -> Vector3<S> {
    vector.fixed_rows::<3>(3).into_owned()
}

/// v × m: how a motion m fixed to a body that moves with v changes.
#[inline]
pub(crate) fn cross_motion<S: Scalar>(v: &Vector6<S>, m: &Vector6<S>) -> Vector6<S> {
    let (velocity, spin) = (linear(v), angular(v));
    spatial(&(spin.cross(&linear(m)) + velocity.cross(&angular(m))), &spin.cross(&angular(m)))
}

/// v ×* f: how a force f fixed to a body that moves with v changes.
#[inline]
pub(crate) fn cross_force<S: Scalar>(v: &Vector6<S>, f: &Vector6<S>) -> Vector6<S> {
    let (velocity, spin) = (linear(v), angular(v));
    spatial(&spin.cross(&linear(f)), &(spin.cross(&angular(f)) + velocity.cross(&linear(f))))
}

/// Mass, first moment and inertia of a rigid body about the frame's origin, along its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SpatialInertia<S: Scalar> {
    /// \[kg\]
    pub(crate) mass: S,
    /// Mass times the place of the center of mass \[kg m\].
    pub(crate) moment: Vector3<S>,
    /// About the origin \[kg m²\].
    pub(crate) inertia: Matrix3<S>,
}

impl<S: Scalar> SpatialInertia<S> {
    /// Inertia of a body with center of mass at `com` and `inertia` about it.
    #[inline]
    pub(crate) fn new(mass: S, com: &Vector3<S>, inertia: &Matrix3<S>) -> Self {
        let moment = com * mass;
        // m (|c|² 1 − c cᵀ)
        let mut about_origin = *inertia - moment * com.transpose();
        let square = moment.dot(com);
        for k in 0..3 {
            about_origin[(k, k)] += square;
        }
        Self { mass, moment, inertia: about_origin }
    }

    /// The momentum of the body that moves with `v`.
    #[inline]
    pub(crate) fn times(&self, v: &Vector6<S>) -> Vector6<S> {
        let (velocity, spin) = (linear(v), angular(v));
        spatial(
            &(velocity * self.mass + spin.cross(&self.moment)),
            &(self.inertia * spin + self.moment.cross(&velocity)),
        )
    }

    /// As a matrix.
    #[inline]
    pub(crate) fn matrix(&self) -> Matrix6<S> {
        let mut matrix = Matrix6::zeros();
        let cross = cross_matrix(&self.moment);
        for k in 0..3 {
            matrix[(k, k)] = self.mass;
        }
        matrix.fixed_view_mut::<3, 3>(3, 0).copy_from(&cross);
        matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(&-cross);
        matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&self.inertia);
        matrix
    }
}

impl<S: Scalar> std::ops::AddAssign<&Self> for SpatialInertia<S> {
    #[inline]
    fn add_assign(&mut self, other: &Self) {
        self.mass += other.mass;
        self.moment += other.moment;
        self.inertia += other.inertia;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_inertia_is_its_matrix_and_forces_are_dual_to_motions() {
        let com = Vector3::<f64>::new(0.1, -0.2, 0.3);
        let inertia = Matrix3::new(2.0, 0.1, 0.2, 0.1, 3.0, -0.1, 0.2, -0.1, 4.0);
        let body = SpatialInertia::new(1.5, &com, &inertia);
        let v = Vector6::<f64>::new(1.0, 2.0, -1.0, 0.5, -0.4, 0.3);
        let w = Vector6::new(-0.3, 0.7, 0.2, 1.1, 0.6, -0.9);
        assert!((body.matrix() * v - body.times(&v)).amax() < 1e-14);
        // ½ v·Iv is the energy of the center's motion and of the turn about it.
        let at_com = linear(&v) + angular(&v).cross(&com);
        let energy = 1.5 * at_com.norm_squared() + angular(&v).dot(&(inertia * angular(&v)));
        assert!((v.dot(&body.times(&v)) - energy).abs() < 1e-12);
        // Power does not change by a common motion.
        let f = body.times(&w);
        let change = cross_motion(&v, &w).dot(&f) + w.dot(&cross_force(&v, &f));
        assert!(change.abs() < 1e-12);
    }
}
