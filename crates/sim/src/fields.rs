//! Analytic distance fields for tests.

use nalgebra::{Matrix3, Point3, Vector3};
use prehend_geometry::{DistanceField, FieldSample};

/// A half-space; `normal` points out of it.
pub(crate) struct HalfSpace {
    pub(crate) normal: Vector3<f64>,
}

impl HalfSpace {
    /// Everything below z = 0.
    pub(crate) fn floor() -> Self {
        Self { normal: Vector3::z() }
    }
}

impl DistanceField for HalfSpace {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        let distance = self.normal.dot(&point.coords);
        let (gradient, hessian) = (self.normal, Matrix3::zeros());
        (distance <= reach).then_some(FieldSample { distance, gradient, hessian })
    }
}

/// Everything outside of a sphere.
#[derive(Clone)]
pub(crate) struct SphereCavity {
    pub(crate) center: Point3<f64>,
    pub(crate) radius: f64,
}

impl DistanceField for SphereCavity {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        let offset = point - self.center;
        let length = offset.norm();
        let distance = self.radius - length;
        if distance > reach {
            return None;
        }
        let n = offset / length;
        let hessian = -(Matrix3::identity() - n * n.transpose()) / length;
        Some(FieldSample { distance, gradient: -n, hessian })
    }
}

/// What a field leaves free.
pub(crate) struct Complement<F>(F);

impl SphereCavity {
    /// The sphere itself.
    pub(crate) fn inside_out(self) -> Complement<Self> {
        Complement(self)
    }
}

impl<F: DistanceField> DistanceField for Complement<F> {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        let FieldSample { distance, gradient, hessian } = self.0.sample(point, f64::INFINITY)?;
        let sample = FieldSample { distance: -distance, gradient: -gradient, hessian: -hessian };
        (sample.distance <= reach).then_some(sample)
    }
}
