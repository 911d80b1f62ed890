//! Color of a surface point and its derivatives along the surface and with the normal.

#![allow(clippy::needless_range_loop)] // loops over lanes index several arrays alike

use nalgebra::{Matrix3, Vector3};

use super::vec3::{Vec3, add, cross, dot, mix, scale, sub, times, vec3};
use crate::light::Light;
use crate::model::{Albedo, Texel};
use crate::posed::Posed;

/// A light in f32, in the mesh frame as well.
pub(crate) struct PosedLight {
    pub(crate) ambient: [f32; 3],
    pub(crate) offset: [f32; 3],
    pub(crate) camera: [Vec3; 3],
    pub(crate) object: [Vec3; 3],
    /// Rows of the rotation from the mesh into the camera frame.
    pub(crate) rotation: [Vec3; 3],
}

impl PosedLight {
    pub(crate) fn new(light: &Light, rotation: &Matrix3<f32>) -> Self {
        let camera = light.directional.map(|d| d.cast::<f32>());
        Self {
            ambient: light.ambient.map(|a| a as f32),
            offset: light.offset.map(|a| a as f32),
            camera: camera.map(|d| vec3(&d)),
            object: camera.map(|d| vec3(&rotation.tr_mul(&d))),
            rotation: [0, 1, 2].map(|i| [0, 1, 2].map(|j| rotation[(i, j)])),
        }
    }
}

/// Unlit color with its derivatives by the barycentric coordinates of corners 1 and 2 (corner 0 taking up the rest), and
/// by the pyramid level of the texture.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Unlit {
    pub(crate) color: [f32; 3],
    pub(crate) along: [[f32; 3]; 2],
    pub(crate) level: [f32; 3],
}

/// A lit surface point.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Shaded {
    pub(crate) color: [f32; 3],
    /// Derivatives of the color by the barycentric coordinates of corners 1 and 2.
    pub(crate) along: [[f32; 3]; 2],
    /// Derivative by a rotation of the surface under the fixed light, camera frame.
    pub(crate) turning: [Vec3; 3],
    /// Derivative by the pyramid level of the texture.
    pub(crate) level: [f32; 3],
}

impl Unlit {
    /// Between the colors of three corners.
    #[inline(always)]
    pub(crate) fn between(corners: &[Vec3; 3], b: [f32; 3]) -> Self {
        let [first, second, third] = *corners;
        Self {
            color: add(mix(b[0], first, b[1], second), scale(third, b[2])),
            along: [sub(second, first), sub(third, first)],
            level: [0.0; 3],
        }
    }

    /// Of a texel at a point of a face with texture coordinates `uv` at its corners.
    #[inline(always)]
    pub(crate) fn textured(texel: &Texel, uv: &[[f32; 2]; 3]) -> Self {
        let along = |i: usize| mix(uv[i][0] - uv[0][0], texel.du, uv[i][1] - uv[0][1], texel.dv);
        Self { color: texel.color, along: [along(1), along(2)], level: texel.dlevel }
    }
}

/// Texture coordinates at barycentric coordinates `b`.
#[inline(always)]
pub(crate) fn coordinates(uv: &[[f32; 2]; 3], b: [f32; 3]) -> [f32; 2] {
    [
        b[0] * uv[0][0] + b[1] * uv[1][0] + b[2] * uv[2][0],
        b[0] * uv[0][1] + b[1] * uv[1][1] + b[2] * uv[2][1],
    ]
}

/// Unlit color at barycentric coordinates `b` of a face.
#[inline]
pub(crate) fn albedo(posed: &Posed, face: usize, b: [f32; 3]) -> Unlit {
    match &posed.model.albedo {
        Albedo::Uniform(color) => Unlit { color: *color, ..Unlit::default() },
        Albedo::Corners(corners) => Unlit::between(&corners[face], b),
        Albedo::Texture(map, corners) => {
            let uv = &corners[face];
            let [u, v] = coordinates(uv, b);
            Unlit::textured(&map.sample(u, v, posed.level), uv)
        }
    }
}

/// Smooth normal between those of a face's corners, on the side seen (`side` is 1 for the outside, −1 for the inside):
/// unit vector, and length before normalizing.
#[inline(always)]
pub(crate) fn normal(corners: &[Vec3; 3], side: f32, b: [f32; 3]) -> (Vec3, f32) {
    let sum = add(mix(b[0], corners[0], b[1], corners[1]), scale(corners[2], b[2]));
    let length = dot(sum, sum).sqrt().max(1e-6);
    (scale(sum, side / length), length)
}

/// Unit normal (camera frame) at barycentric coordinates `b` of a face, on the side seen.
pub(crate) fn posed_normal(posed: &Posed, face: usize, b: [f32; 3]) -> Vec3 {
    let corners = posed.model.normals[face].each_ref().map(vec3);
    let side = if posed.projected.facing[face] < 0 { -1.0 } else { 1.0 };
    vec3(&(posed.rotation * Vector3::from(normal(&corners, side, b).0)))
}

/// Lit color at barycentric coordinates `b` of a face with normals `corners` at its corners.
#[inline(always)]
pub(crate) fn lit<const DERIVATIVES: bool>(
    lighting: &PosedLight,
    corners: &[Vec3; 3],
    side: f32,
    b: [f32; 3],
    unlit: &Unlit,
) -> Shaded {
    let (n, length) = normal(corners, side, b);
    let in_camera = if DERIVATIVES { times(&lighting.rotation, n) } else { n };
    let turns = [sub(corners[1], corners[0]), sub(corners[2], corners[0])];
    let mut out = Shaded::default();
    for k in 0..3 {
        let light = lighting.object[k];
        let along_normal = dot(light, n);
        let factor = lighting.ambient[k] + along_normal;
        // Surfaces facing away are black, whatever the pose. (Selected, not branched on: this is a loop over lanes.)
        let seen = if factor > 0.0 { 1.0 } else { 0.0 };
        let factor = factor.max(0.0);
        let albedo = unlit.color[k];
        out.color[k] = albedo * factor + lighting.offset[k];
        if !DERIVATIVES {
            continue;
        }
        let lit_albedo = albedo * seen;
        // The normal turns by the part of the corners' difference across it.
        let across = scale(sub(light, scale(n, along_normal)), lit_albedo * (side / length));
        for i in 0..2 {
            out.along[i][k] = unlit.along[i][k] * factor + dot(across, turns[i]);
        }
        out.turning[k] = scale(cross(in_camera, lighting.camera[k]), lit_albedo);
        out.level[k] = unlit.level[k] * factor;
    }
    out
}

/// Lit color at barycentric coordinates `b` of a face.
#[inline]
pub(crate) fn shade<const DERIVATIVES: bool>(
    posed: &Posed,
    lighting: &PosedLight,
    face: usize,
    b: [f32; 3],
) -> Shaded {
    let corners = posed.model.normals[face].each_ref().map(vec3);
    let side = if posed.projected.facing[face] < 0 { -1.0 } else { 1.0 };
    lit::<DERIVATIVES>(lighting, &corners, side, b, &albedo(posed, face, b))
}
