//! Colour of a surface point and its derivatives along the surface and with the normal.

use nalgebra::{Matrix3, Vector3};

use crate::light::Light;
use crate::model::Albedo;
use crate::posed::Posed;

/// Lighting in f32, in the mesh frame as well.
pub(crate) struct Lighting {
    ambient: [f32; 3],
    camera: [Vector3<f32>; 3],
    object: [Vector3<f32>; 3],
    /// No channel depends on the normal.
    flat: bool,
}

impl Lighting {
    pub(crate) fn new(light: &Light, rotation: &Matrix3<f32>) -> Self {
        let camera = light.directional.map(|d| d.cast::<f32>());
        Self {
            ambient: light.ambient.map(|a| a as f32),
            camera,
            object: camera.map(|d| rotation.tr_mul(&d)),
            flat: camera.iter().all(|d| *d == Vector3::zeros()),
        }
    }
}

/// A lit surface point.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Shaded {
    pub(crate) color: [f32; 3],
    /// Derivatives of the colour by the barycentric coordinates of corners 1 and 2 (corner 0 taking up the rest).
    pub(crate) along: [[f32; 3]; 2],
    /// Derivative by a rotation of the surface under the fixed light, camera frame.
    pub(crate) turning: [Vector3<f32>; 3],
    /// Derivative by the pyramid level of the texture.
    pub(crate) level: [f32; 3],
}

/// Unlit colour with its derivatives by two barycentric coordinates and the pyramid level.
#[inline]
pub(crate) fn albedo(
    posed: &Posed,
    face: usize,
    b: [f32; 3],
) -> ([f32; 3], [[f32; 3]; 2], [f32; 3]) {
    match &posed.model.albedo {
        Albedo::Uniform(color) => (*color, [[0.0; 3]; 2], [0.0; 3]),
        Albedo::Corners(corners) => {
            let c = &corners[face];
            let along = [1, 2].map(|i| [0, 1, 2].map(|k| c[i][k] - c[0][k]));
            let color = [0, 1, 2].map(|k| b[0] * c[0][k] + b[1] * c[1][k] + b[2] * c[2][k]);
            (color, along, [0.0; 3])
        }
        Albedo::Texture(map, corners) => {
            let uv = &corners[face];
            let at = |i: usize| b[0] * uv[0][i] + b[1] * uv[1][i] + b[2] * uv[2][i];
            let texel = map.sample(at(0), at(1), posed.level);
            let along = [1, 2].map(|i| {
                let (du, dv) = (uv[i][0] - uv[0][0], uv[i][1] - uv[0][1]);
                [0, 1, 2].map(|k| texel.du[k] * du + texel.dv[k] * dv)
            });
            (texel.color, along, texel.dlevel)
        }
    }
}

/// Smooth normal towards the camera side of the face, mesh frame: unit vector, length before normalising, and
/// the sign of the side seen.
#[inline]
pub(crate) fn normal(posed: &Posed, face: usize, b: [f32; 3]) -> (Vector3<f32>, f32, f32) {
    let n = &posed.model.normals[face];
    let sum = n[0] * b[0] + n[1] * b[1] + n[2] * b[2];
    let length = sum.norm().max(1e-6);
    let side = if posed.projected.facing[face] < 0 { -1.0 } else { 1.0 };
    (sum * (side / length), length, side)
}

/// Lit colour at barycentric coordinates `b` of a face.
#[inline]
pub(crate) fn shade<const DERIVATIVES: bool>(
    posed: &Posed,
    lighting: &Lighting,
    face: usize,
    b: [f32; 3],
) -> Shaded {
    let (albedo, albedo_along, albedo_level) = albedo(posed, face, b);
    let mut out = Shaded::default();
    if lighting.flat {
        let factor = lighting.ambient.map(|a| a.max(0.0));
        for k in 0..3 {
            out.color[k] = albedo[k] * factor[k];
            (0..2).for_each(|i| out.along[i][k] = albedo_along[i][k] * factor[k]);
            out.level[k] = albedo_level[k] * factor[k];
        }
        return out;
    }
    let (n, length, side) = normal(posed, face, b);
    let corners = &posed.model.normals[face];
    let in_camera = if DERIVATIVES { posed.rotation * n } else { n };
    for k in 0..3 {
        let light = &lighting.object[k];
        let along_normal = light.dot(&n);
        let factor = lighting.ambient[k] + along_normal;
        if factor <= 0.0 {
            continue;
        }
        out.color[k] = albedo[k] * factor;
        if !DERIVATIVES {
            continue;
        }
        // The normal turns by the part of the corners' difference across it.
        let across = (light - n * along_normal) * (side / length);
        for i in 0..2 {
            let change = across.dot(&(corners[i + 1] - corners[0]));
            out.along[i][k] = albedo_along[i][k] * factor + albedo[k] * change;
        }
        out.turning[k] = in_camera.cross(&lighting.camera[k]) * albedo[k];
        out.level[k] = albedo_level[k] * factor;
    }
    out
}
