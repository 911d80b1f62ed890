//! A lit point of a surface, from barycentric coordinates to color and back.

use nalgebra::Vector3;
use prehend_autodiff::Fwd;

use super::frame::Frame;
use super::sums::{Sums, TexelUse};
use crate::model::Albedo;
use crate::precision::double;
use crate::shading::{Chunks, Shader, SurfacePoint, by_parameters, by_point};

/// A scene with its shader.
pub(super) struct Lit<'a, Sh> {
    pub(super) frame: &'a Frame,
    pub(super) shader: &'a Sh,
    pub(super) parameters: &'a [f64],
    pub(super) background: [f64; 3],
}

/// A lit point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) face: usize,
    pub(super) body: usize,
    pub(super) b: [f64; 3],
    /// Sum of the corner normals, camera frame, before it is turned to the visible side and normalized.
    normal_sum: Vector3<f64>,
    pub(super) point: SurfacePoint<f64>,
    pub(super) color: [f64; 3],
}

/// Normals shorter than this have no direction.
const LEAST_NORMAL: f64 = 1e-6;

impl<Sh: Shader> Lit<'_, Sh> {
    /// The point of a face with barycentric coordinates `b`.
    #[inline]
    pub(super) fn sample(&self, face: usize, b: [f64; 3]) -> Sample {
        let body_index = self.frame.body_of(face);
        let body = &self.frame.bodies[body_index];
        let own = face - body.first_face;
        let corners = self.frame.corners(face);
        let normals = body.model.normals[own].each_ref().map(double);
        let normal_sum = body.rotation * mix(&normals, b);
        let length = normal_sum.norm();
        let normal = match length > LEAST_NORMAL {
            true => normal_sum * (self.side(face) / length),
            false => Vector3::zeros(),
        };
        let albedo = match &body.model.albedo {
            Albedo::Uniform(color) => color.map(f64::from),
            Albedo::Corners(colors) => mix_colors(&colors[own], b),
            Albedo::Texture(map, coordinates) => {
                let [u, v] = mix_coordinates(&coordinates[own], b);
                map.blend(&map.taps(u, v, body.level))
            }
        };
        let point = SurfacePoint { position: mix(&corners, b), normal, albedo };
        let color = self.shader.shade(self.parameters, &point);
        Sample { face, body: body_index, b, normal_sum, point, color }
    }

    /// Carries adjoints of the color and the normal of `sample` back: adds to `sums`, and returns those of the
    /// barycentric coordinates.
    #[inline]
    pub(super) fn sample_back(
        &self,
        sample: &Sample,
        chunks: &Chunks,
        by_color: [f64; 3],
        by_normal: Vector3<f64>,
        sums: &mut Sums,
    ) -> [f64; 3] {
        let body = &self.frame.bodies[sample.body];
        let own = sample.face - body.first_face;
        let mut by =
            SurfacePoint { position: Vector3::zeros(), normal: Vector3::zeros(), albedo: [0.0; 3] };
        if by_color != [0.0; 3] {
            by = by_point(self.shader, chunks, &sample.point, by_color);
            by_parameters(self.shader, chunks, &sample.point, by_color, &mut sums.parameters);
        }
        by.normal += by_normal;
        let mut by_b = [0.0; 3];
        let corners = self.frame.corners(sample.face);
        let length = sample.normal_sum.norm();
        if by.normal != Vector3::zeros() && length > LEAST_NORMAL {
            let n = sample.point.normal;
            let by_sum = (by.normal - n * n.dot(&by.normal)) * (self.side(sample.face) / length);
            sums.bodies[sample.body].turn += sample.normal_sum.cross(&by_sum);
            let in_model = body.rotation.tr_mul(&by_sum);
            let face = sums.face(sample.face);
            for (k, normal) in body.model.normals[own].iter().enumerate() {
                by_b[k] += double(normal).dot(&in_model);
                face.normal[k] += in_model * sample.b[k];
            }
        }
        match &body.model.albedo {
            Albedo::Uniform(_) => {
                let sum = &mut sums.bodies[sample.body].uniform;
                (0..3).for_each(|c| sum[c] += by.albedo[c]);
            }
            Albedo::Corners(colors) => {
                let face = sums.face(sample.face);
                for (k, color) in colors[own].iter().enumerate() {
                    for (c, value) in color.iter().enumerate() {
                        by_b[k] += f64::from(*value) * by.albedo[c];
                        face.albedo[k][c] += sample.b[k] * by.albedo[c];
                    }
                }
            }
            Albedo::Texture(map, coordinates) => {
                let coordinates = &coordinates[own];
                let [u, v] = mix_coordinates(coordinates, sample.b);
                let [fu, fv, level] = Fwd::<3>::variables([u, v, body.level]);
                let texel = map.blend(&map.taps(fu, fv, level));
                let along = |i: usize| -> f64 {
                    (0..3).map(|c| by.albedo[c] * texel[c].derivative[i]).sum()
                };
                let (by_u, by_v) = (along(0), along(1));
                sums.bodies[sample.body].level += along(2);
                for (k, [u, v]) in coordinates.iter().enumerate() {
                    by_b[k] += f64::from(*u) * by_u + f64::from(*v) * by_v;
                }
                let (object, adjoint) = (sample.body as u32, by.albedo);
                sums.texels.push(TexelUse { object, place: [u, v], adjoint });
            }
        }
        if by.position != Vector3::zeros() {
            let face = sums.face(sample.face);
            for k in 0..3 {
                by_b[k] += corners[k].dot(&by.position);
                face.position[k] += by.position * sample.b[k];
            }
        }
        by_b
    }

    /// −1 where the inside of a face is seen.
    #[inline]
    fn side(&self, face: usize) -> f64 {
        if self.frame.facing[face] < 0 { -1.0 } else { 1.0 }
    }
}

#[inline]
fn mix(corners: &[Vector3<f64>; 3], b: [f64; 3]) -> Vector3<f64> {
    corners[0] * b[0] + corners[1] * b[1] + corners[2] * b[2]
}

#[inline]
fn mix_colors(corners: &[[f32; 3]; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|c| (0..3).map(|k| b[k] * f64::from(corners[k][c])).sum())
}

#[inline]
fn mix_coordinates(corners: &[[f32; 2]; 3], b: [f64; 3]) -> [f64; 2] {
    [0, 1].map(|c| (0..3).map(|k| b[k] * f64::from(corners[k][c])).sum())
}
