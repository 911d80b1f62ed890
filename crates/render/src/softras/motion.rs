//! Derivatives of a projected face by the twist of the pose.
//!
//! A point X of the body moves by t + ω × (X − c), so that a gradient g by the point gives (g, (X − c) × g). For the ray d
//! of a pixel, weight W_i is d · (X_j × X_k) but for a factor κ_i that depends on the depths. What all three weights have
//! of it in common moves no barycentric coordinate; without the perspective correction the factor Z_i is left. The
//! derivative of d · (X_j × X_k) by (t, ω) is (e × d, N × d + e × (d × c)) with e = X_k − X_j, N = (X_j − c) × (X_k − c): what
//! has to be summed over faces are e and N, and the ray comes in once a pixel.

#![allow(clippy::needless_range_loop)] // closures from elsewhere would be compiled for the plain instructions

use nalgebra::Vector3;

use super::face::Face;
use super::fragment::Fragment;
use super::number::Number;
use crate::camera::Camera;

/// A derivative by the twist (translation, rotation).
pub(crate) type TwistRow<T> = [T; 6];

#[inline(always)]
pub(crate) fn cross<T: Number>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Motion of a face with the body: its terms in derivatives by the twist.
#[derive(Clone, Debug)]
pub(crate) struct FaceMotion {
    /// X_i − c \[m\].
    corner: [[f32; 3]; 3],
    /// κ_i e_i.
    edge: [[f32; 3]; 3],
    /// κ_i N_i.
    moment: [[f32; 3]; 3],
}

impl FaceMotion {
    /// For corners at (column, row, Z) \[px, m\] and twists about `center` (camera frame).
    pub(crate) fn new(
        face: &Face,
        corners: [[f64; 3]; 3],
        camera: &Camera,
        center: &Vector3<f64>,
    ) -> Self {
        let place = |[u, v, z]: [f64; 3]| {
            Vector3::new((u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z)
        };
        let corner = corners.map(|c| place(c) - center);
        let (mut edge, mut moment) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let scale = camera.fx * camera.fy / (corners[j][2] * corners[k][2]);
            let scale = scale * f64::from(face.share[i]);
            let along = (corner[k] - corner[j]) * scale;
            edge[i] = along.cast().into();
            moment[i] = corner[j].cross(&along).cast().into();
        }
        Self { corner: corner.map(|c| c.cast().into()), edge, moment }
    }
}

/// Where a pixel looks, and about which point twists turn.
#[derive(Clone, Copy)]
pub(crate) struct Ray<T> {
    /// X/Z.
    pub(crate) direction: [T; 3],
    /// c \[m\].
    pub(crate) center: [T; 3],
    /// Focal lengths \[px\].
    pub(crate) focal: [T; 2],
}

/// Derivative of a signed squared distance \[px²\] by the twist.
pub(crate) struct DistanceRow<T> {
    linear: [T; 3],
    angular: [T; 3],
}

impl<T: Number> Ray<T> {
    /// That of a fragment of `face`: its foot moves as a point of the edge does.
    #[inline(always)]
    pub(crate) fn distance_row(&self, face: &Face, fragment: &Fragment<T>) -> DistanceRow<T> {
        let [gradient_x, gradient_y] = fragment.distance_gradient();
        let is = |value: f32| gradient_x.like(value);
        let [f, g, h] = fragment.foot;
        let inverse_z =
            f * is(face.inverse_z[0]) + g * is(face.inverse_z[1]) + h * is(face.inverse_z[2]);
        let x = self.direction[0] + fragment.to_foot[0] / self.focal[0];
        let y = self.direction[1] + fragment.to_foot[1] / self.focal[1];
        let (a, b) =
            (gradient_x * self.focal[0] * inverse_z, gradient_y * self.focal[1] * inverse_z);
        let linear = [a, b, -(a * x + b * y)];
        let z = is(1.0) / inverse_z;
        let arm = [x * z - self.center[0], y * z - self.center[1], z - self.center[2]];
        DistanceRow { linear, angular: cross(arm, linear) }
    }
}

/// Sums of what makes a row, over the faces of a pixel.
#[derive(Clone, Copy)]
pub(crate) struct RowSum<T> {
    pub(crate) linear: [T; 3],
    pub(crate) angular: [T; 3],
    edge: [T; 3],
    moment: [T; 3],
}

impl<T: Number> RowSum<T> {
    #[inline(always)]
    pub(crate) fn new(zero: T) -> Self {
        Self { linear: [zero; 3], angular: [zero; 3], edge: [zero; 3], moment: [zero; 3] }
    }

    #[inline(always)]
    pub(crate) fn add_distance(&mut self, factor: T, row: &DistanceRow<T>) {
        for n in 0..3 {
            self.linear[n] = self.linear[n] + factor * row.linear[n];
            self.angular[n] = self.angular[n] + factor * row.angular[n];
        }
    }

    /// Adds `by_z` times the depth's derivative at fixed barycentric coordinates, and `by_weight` times those of the weights.
    #[inline(always)]
    pub(crate) fn add_surface(
        &mut self,
        motion: &FaceMotion,
        face: &Face,
        fragment: &Fragment<T>,
        perspective: bool,
        by_z: T,
        by_weight: [T; 3],
    ) {
        let is = |value: f32| by_z.like(value);
        for i in 0..3 {
            let mut along_z = by_z * fragment.b[i];
            if !perspective {
                // W_i grows with Z_i.
                let weight = fragment.b[i] / fragment.inverse_sum;
                along_z = along_z + by_weight[i] * weight * is(face.inverse_z[i]);
            }
            let corner = motion.corner[i];
            self.linear[2] = self.linear[2] + along_z;
            self.angular[0] = self.angular[0] + along_z * is(corner[1]);
            self.angular[1] = self.angular[1] - along_z * is(corner[0]);
            for n in 0..3 {
                self.edge[n] = self.edge[n] + by_weight[i] * is(motion.edge[i][n]);
                self.moment[n] = self.moment[n] + by_weight[i] * is(motion.moment[i][n]);
            }
        }
    }

    #[inline(always)]
    pub(crate) fn row(&self, ray: &Ray<T>) -> TwistRow<T> {
        let linear = cross(self.edge, ray.direction);
        let angular = cross(self.moment, ray.direction);
        let offset = cross(self.edge, cross(ray.direction, ray.center));
        [
            self.linear[0] + linear[0],
            self.linear[1] + linear[1],
            self.linear[2] + linear[2],
            self.angular[0] + angular[0] + offset[0],
            self.angular[1] + angular[1] + offset[1],
            self.angular[2] + angular[2] + offset[2],
        ]
    }
}
