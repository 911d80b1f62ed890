//! A rigid body and the surface samples through which it touches its surroundings.

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use thiserror::Error;

/// Why a body cannot be simulated.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum BodyError {
    /// The mass is not a positive number.
    #[error("mass must be positive and finite, is {0} kg")]
    Mass(f64),
    /// The inertia is not symmetric and positive definite.
    #[error("inertia must be symmetric and positive definite")]
    Inertia,
    /// The centre of mass is not finite.
    #[error("centre of mass must be finite")]
    CenterOfMass,
    /// Points and areas differ in number.
    #[error("{points} surface points but {areas} areas")]
    Samples {
        /// Number of points.
        points: usize,
        /// Number of areas.
        areas: usize,
    },
}

/// Mass, inertia and centre of mass of a rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidBody {
    mass: f64,
    inertia: Matrix3<f64>,
    inverse_inertia: Matrix3<f64>,
    com: Point3<f64>,
}

impl RigidBody {
    /// A body of `mass` \[kg\], `inertia` about its centre of mass along the model's axes \[kg m²\] and
    /// centre of mass `com` in its model frame \[m\].
    ///
    /// # Errors
    /// Unless the mass is positive, the inertia symmetric positive definite and everything finite.
    pub fn new(mass: f64, inertia: Matrix3<f64>, com: Point3<f64>) -> Result<Self, BodyError> {
        if !(mass > 0.0 && mass.is_finite()) {
            return Err(BodyError::Mass(mass));
        }
        if !com.iter().all(|c| c.is_finite()) {
            return Err(BodyError::CenterOfMass);
        }
        let asymmetry = (inertia - inertia.transpose()).norm();
        if !inertia.iter().all(|x| x.is_finite()) || asymmetry > 1e-6 * inertia.norm() {
            return Err(BodyError::Inertia);
        }
        let inertia = (inertia + inertia.transpose()) * 0.5;
        let inverse_inertia = inertia.cholesky().ok_or(BodyError::Inertia)?.inverse();
        Ok(Self { mass, inertia, inverse_inertia, com })
    }

    /// Mass \[kg\].
    #[inline]
    pub fn mass(&self) -> f64 {
        self.mass
    }

    /// Inertia about the centre of mass, along the model's axes \[kg m²\].
    #[inline]
    pub fn inertia(&self) -> &Matrix3<f64> {
        &self.inertia
    }

    /// Centre of mass in the model frame \[m\].
    #[inline]
    pub fn com(&self) -> &Point3<f64> {
        &self.com
    }

    /// Inertia about the centre of mass, along the world's axes \[kg m²\].
    #[inline]
    pub fn world_inertia(&self, rotation: &UnitQuaternion<f64>) -> Matrix3<f64> {
        let r = rotation.to_rotation_matrix();
        r.matrix() * self.inertia * r.matrix().transpose()
    }

    /// Inverse of [`Self::world_inertia`].
    #[inline]
    pub fn inverse_world_inertia(&self, rotation: &UnitQuaternion<f64>) -> Matrix3<f64> {
        let r = rotation.to_rotation_matrix();
        r.matrix() * self.inverse_inertia * r.matrix().transpose()
    }

    /// `t_world_com` of a body whose model frame is at `t_world_model`.
    #[inline]
    pub fn com_pose(&self, t_world_model: &Isometry3<f64>) -> Isometry3<f64> {
        t_world_model * Translation3::from(self.com.coords)
    }

    /// `t_world_model` of a body whose centre-of-mass frame is at `t_world_com`.
    #[inline]
    pub fn model_pose(&self, t_world_com: &Isometry3<f64>) -> Isometry3<f64> {
        t_world_com * Translation3::from(-self.com.coords)
    }

    /// Surface samples from `points` in the model frame \[m\] and the `areas` they stand for \[m²\].
    ///
    /// # Errors
    /// Where the two differ in number.
    pub fn surface_points(
        &self,
        points: &[Point3<f64>],
        areas: &[f64],
    ) -> Result<Vec<SurfacePoint>, BodyError> {
        if points.len() != areas.len() {
            return Err(BodyError::Samples { points: points.len(), areas: areas.len() });
        }
        let samples = points.iter().zip(areas);
        Ok(samples.map(|(p, &area)| SurfacePoint { position: p - self.com, area }).collect())
    }
}

/// A sample of a body's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position relative to the centre of mass, along the model's axes \[m\].
    pub position: Vector3<f64>,
    /// Area the sample stands for \[m²\].
    pub area: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_bodies_are_refused() {
        let (i, o) = (Matrix3::identity(), Point3::origin());
        assert_eq!(RigidBody::new(0.0, i, o), Err(BodyError::Mass(0.0)));
        assert!(RigidBody::new(f64::NAN, i, o).is_err());
        assert_eq!(RigidBody::new(1.0, -i, o), Err(BodyError::Inertia));
        assert_eq!(RigidBody::new(1.0, i * f64::NAN, o), Err(BodyError::Inertia));
        let nowhere = Point3::new(f64::NAN, 0.0, 0.0);
        assert_eq!(RigidBody::new(1.0, i, nowhere), Err(BodyError::CenterOfMass));
        let body = RigidBody::new(1.0, i, o).unwrap();
        let error = body.surface_points(&[o], &[]);
        assert_eq!(error, Err(BodyError::Samples { points: 1, areas: 0 }));
    }

    #[test]
    fn model_and_com_poses_are_inverse() {
        let com = Point3::new(0.1, -0.2, 0.3);
        let body = RigidBody::new(2.0, Matrix3::identity(), com).unwrap();
        let pose = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.3, 0.2, -0.5));
        let at_com = body.com_pose(&pose);
        assert!((at_com.translation.vector - (pose * com).coords).norm() < 1e-15);
        assert!((body.model_pose(&at_com).to_homogeneous() - pose.to_homogeneous()).norm() < 1e-15);
    }
}
