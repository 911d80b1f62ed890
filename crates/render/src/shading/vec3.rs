//! Vectors of three numbers whose operations always become part of the loop they stand in.
//!
//! The loops over lanes are compiled once for each instruction set (`contour/lanes.rs`); a call left standing in such a
//! loop would run with the wrong one and keep the loop from being vectorized.

use nalgebra::Vector3;

pub(crate) type Vec3 = [f32; 3];

#[inline(always)]
pub(crate) fn vec3(v: &Vector3<f32>) -> Vec3 {
    [v.x, v.y, v.z]
}

#[inline(always)]
pub(crate) fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(crate) fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn scale(a: Vec3, s: f32) -> Vec3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

#[inline(always)]
pub(crate) fn dot(a: Vec3, b: Vec3) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The product of a matrix, given by its rows, with a vector.
#[inline(always)]
pub(crate) fn times(rows: &[Vec3; 3], v: Vec3) -> Vec3 {
    [dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)]
}

/// `p a + q b`.
#[inline(always)]
pub(crate) fn mix(p: f32, a: Vec3, q: f32, b: Vec3) -> Vec3 {
    [p * a[0] + q * b[0], p * a[1] + q * b[1], p * a[2] + q * b[2]]
}
