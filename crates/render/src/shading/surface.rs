//! Color of a surface point and its derivatives along the surface and with the normal.

#![allow(clippy::needless_range_loop)] // loops over lanes index several arrays alike

use glam::{Mat3, Vec2, Vec3};

use crate::light::Light;
use crate::model::{Albedo, Texel};
use crate::posed::Posed;
use crate::precision::single;

/// A light in f32, in the mesh frame as well.
pub(crate) struct PosedLight {
    pub(crate) ambient: [f32; 3],
    pub(crate) offset: [f32; 3],
    pub(crate) camera: [Vec3; 3],
    pub(crate) object: [Vec3; 3],
    /// From the mesh into the camera frame.
    pub(crate) rotation: Mat3,
}

impl PosedLight {
    pub(crate) fn new(light: &Light, rotation: Mat3) -> Self {
        let camera = light.directional.each_ref().map(single);
        Self {
            ambient: light.ambient.map(|a| a as f32),
            offset: light.offset.map(|a| a as f32),
            camera,
            object: camera.map(|d| rotation.transpose() * d),
            rotation,
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
    pub(crate) fn between([first, second, third]: [Vec3; 3], b: [f32; 3]) -> Self {
        Self {
            color: (b[0] * first + b[1] * second + b[2] * third).into(),
            along: [(second - first).into(), (third - first).into()],
            level: [0.0; 3],
        }
    }

    /// Unlit color of a texel at a point of a face with texture coordinates `uv` at its corners.
    #[inline(always)]
    pub(crate) fn textured(texel: &Texel, uv: &[[f32; 2]; 3]) -> Self {
        let [origin, first, second] = uv.map(Vec2::from);
        let along = |to: Vec2| {
            let by = to - origin;
            (by.x * Vec3::from(texel.du) + by.y * Vec3::from(texel.dv)).into()
        };
        Self { color: texel.color, along: [along(first), along(second)], level: texel.dlevel }
    }
}

/// Texture coordinates at barycentric coordinates `b`.
#[inline(always)]
pub(crate) fn coordinates(uv: &[[f32; 2]; 3], b: [f32; 3]) -> [f32; 2] {
    let [first, second, third] = uv.map(Vec2::from);
    (b[0] * first + b[1] * second + b[2] * third).into()
}

/// Unlit color at barycentric coordinates `b` of a face.
#[inline]
pub(crate) fn albedo(posed: &Posed, face: usize, b: [f32; 3]) -> Unlit {
    match &posed.model.albedo {
        Albedo::Uniform(color) => Unlit { color: *color, ..Unlit::default() },
        Albedo::Corners(corners) => Unlit::between(corners[face].map(Vec3::from), b),
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
    let sum = b[0] * corners[0] + b[1] * corners[1] + b[2] * corners[2];
    let length = sum.dot(sum).sqrt().max(1e-6);
    (sum * (side / length), length)
}

/// Unit normal (camera frame) at barycentric coordinates `b` of a face, on the side seen.
pub(crate) fn posed_normal(posed: &Posed, face: usize, b: [f32; 3]) -> Vec3 {
    let side = if posed.projected.facing[face] < 0 { -1.0 } else { 1.0 };
    posed.rotation * normal(&posed.model.normals[face], side, b).0
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
    let in_camera = if DERIVATIVES { lighting.rotation * n } else { n };
    let turns = [corners[1] - corners[0], corners[2] - corners[0]];
    let mut out = Shaded::default();
    for k in 0..3 {
        let light = lighting.object[k];
        let along_normal = light.dot(n);
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
        let across = (light - n * along_normal) * (lit_albedo * (side / length));
        for i in 0..2 {
            out.along[i][k] = unlit.along[i][k] * factor + across.dot(turns[i]);
        }
        out.turning[k] = in_camera.cross(lighting.camera[k]) * lit_albedo;
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
    let corners = &posed.model.normals[face];
    let side = if posed.projected.facing[face] < 0 { -1.0 } else { 1.0 };
    lit::<DERIVATIVES>(lighting, corners, side, b, &albedo(posed, face, b))
}
