//! Between the vectors of double precision (nalgebra) and those of single precision (glam).
//!
//! Poses, models and losses are in f64; what is done for every vertex and pixel is in f32.

use glam::{DVec3, Vec3};
use nalgebra::Vector3;

pub(crate) fn single(v: &Vector3<f64>) -> Vec3 {
    DVec3::from(*v).as_vec3()
}

pub(crate) fn double(v: &Vec3) -> Vector3<f64> {
    v.as_dvec3().into()
}
