//! The lit surface under several pixels at once.

#![allow(clippy::needless_range_loop)] // closures from elsewhere would be compiled for the plain instructions

use super::number::Number;
use crate::model::Albedo;
use crate::posed::Posed;
use crate::shading::surface::{PosedLight, Unlit, albedo};

/// The most lanes that a texture is sampled for.
const MOST_LANES: usize = 16;

/// The lit surface of a face at points of it, and what its derivatives are made of.
#[derive(Clone, Copy)]
pub(super) struct Lit<T> {
    pub(super) color: [T; 3],
    /// Unit normal on the side that is seen, mesh frame.
    pub(super) normal: [T; 3],
    /// By which a turn of the normal along the light changes the color.
    pub(super) turning: [T; 3],
    /// Derivatives of the color by the barycentric coordinates of corners 1 and 2.
    pub(super) along: [[T; 3]; 2],
    /// By the pyramid level of the texture.
    pub(super) level: [T; 3],
}

/// Between the values `corners` have.
#[inline(always)]
fn between<T: Number>(corners: [f32; 3], b: [T; 3]) -> T {
    b[0] * b[0].like(corners[0]) + b[1] * b[0].like(corners[1]) + b[2] * b[0].like(corners[2])
}

/// Unlit color, derivatives by the coordinates of corners 1 and 2 and by the level.
#[inline(always)]
fn unlit<T: Number>(posed: &Posed, face: usize, b: [T; 3]) -> ([T; 3], [[T; 3]; 2], [T; 3]) {
    let is = |value: f32| b[0].like(value);
    let zero = [is(0.0); 3];
    let (mut color, mut along) = (zero, [zero; 2]);
    match &posed.model.albedo {
        Albedo::Uniform(uniform) => {
            for k in 0..3 {
                color[k] = is(uniform[k]);
            }
            (color, along, zero)
        }
        Albedo::Corners(corners) => {
            let [p, q, r] = &corners[face];
            for k in 0..3 {
                color[k] = between([p[k], q[k], r[k]], b);
                along[0][k] = is(q[k] - p[k]);
                along[1][k] = is(r[k] - p[k]);
            }
            (color, along, zero)
        }
        Albedo::Texture(..) => textured(posed, face, b),
    }
}

/// Unlit color of a texture with its derivatives, point by point.
#[inline(always)]
fn textured<T: Number>(posed: &Posed, face: usize, b: [T; 3]) -> ([T; 3], [[T; 3]; 2], [T; 3]) {
    let mut values = [[0.0f32; MOST_LANES]; 12];
    for lane in 0..T::LANES.min(MOST_LANES) {
        let at = [b[0].lanes()[lane], b[1].lanes()[lane], b[2].lanes()[lane]];
        let Unlit { color, along: [first, second], level } = albedo(posed, face, at);
        for (i, part) in [color, first, second, level].iter().enumerate() {
            for k in 0..3 {
                values[3 * i + k][lane] = part[k];
            }
        }
    }
    let mut out = [[b[0]; 3]; 4];
    for i in 0..4 {
        for k in 0..3 {
            out[i][k] = b[0].loaded(&values[3 * i + k][..T::LANES.min(MOST_LANES)]);
        }
    }
    let [color, first, second, level] = out;
    (color, [first, second], level)
}

impl<T: Number> Lit<T> {
    /// At barycentric coordinates `b` of a face.
    #[inline(always)]
    pub(super) fn new(posed: &Posed, lighting: &PosedLight, face: usize, b: [T; 3]) -> Self {
        let is = |value: f32| b[0].like(value);
        let zero = is(0.0);
        let corners = &posed.model.normals[face];
        let mut normal = [zero; 3];
        for n in 0..3 {
            normal[n] = between([corners[0][n], corners[1][n], corners[2][n]], b);
        }
        let [x, y, z] = normal;
        let (length, least) = ((x * x + y * y + z * z).sqrt(), is(1e-6));
        let length = T::pick(least.below(length), length, least);
        let side = if posed.projected.facing[face] < 0 { -1.0 } else { 1.0 };
        let scale = is(side) / length;
        for n in 0..3 {
            normal[n] = normal[n] * scale;
        }
        let (unlit, unlit_along, level) = unlit(posed, face, b);
        let mut out = Self { color: unlit, normal, turning: unlit, along: unlit_along, level };
        for k in 0..3 {
            let light = lighting.object[k];
            let light = [is(light.x), is(light.y), is(light.z)];
            let along_normal = light[0] * normal[0] + light[1] * normal[1] + light[2] * normal[2];
            let factor = is(lighting.ambient[k]) + along_normal;
            // Surfaces facing away are black, whatever the pose.
            let seen = zero.below(factor);
            let factor = T::pick(seen, factor, zero);
            out.color[k] = unlit[k] * factor + is(lighting.offset[k]);
            out.turning[k] = T::pick(seen, unlit[k], zero);
            out.level[k] = level[k] * factor;
            // The normal turns by the part of the corners' difference across it.
            let size = out.turning[k] * scale;
            for i in 0..2 {
                let mut turn = zero;
                for n in 0..3 {
                    let across = light[n] - normal[n] * along_normal;
                    turn = turn + across * is(corners[i + 1][n] - corners[0][n]);
                }
                out.along[i][k] = unlit_along[i][k] * factor + turn * size;
            }
        }
        out
    }
}
