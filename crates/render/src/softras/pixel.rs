//! Color, coverage and depth of pixels, and their derivatives by the pose.

#![allow(clippy::needless_range_loop)] // closures from elsewhere would be compiled for the plain instructions

use std::sync::OnceLock;

use nalgebra::Point3;

use super::blend::Blend;
use super::face::Face;
use super::lit::Lit;
use super::motion::{FaceMotion, Ray, RowSum, TwistRow, cross};
use super::number::Number;
use super::run::{Run, places};
use super::settings::Settings;
use crate::camera::Camera;
use crate::posed::Posed;
use crate::precision::single;
use crate::shading::surface::PosedLight;
use crate::view::{Pixel, Seen};

/// Least share of a fragment in its pixel. Smaller ones are left out: 64 of them are less than 1e-6 of its color.
pub(crate) const LEAST_SHARE: f32 = 1e-8;

/// A posed, lit model with the faces that are drawn, and the point about which twists turn (camera frame).
pub(crate) struct SoftScene<'a> {
    pub(crate) posed: Posed<'a>,
    pub(crate) lighting: PosedLight,
    pub(crate) settings: Settings,
    pub(crate) camera: Camera,
    /// Column, row \[px\] and Z \[m\] of the vertices.
    pub(crate) screen: Vec<[f64; 3]>,
    pub(crate) faces: Vec<Face>,
    /// The model's index of each of them.
    pub(crate) ids: Vec<u32>,
    /// How those that are seen move.
    pub(crate) motions: Vec<OnceLock<FaceMotion>>,
    pub(crate) twist_center: Point3<f64>,
}

/// The pixels of a run, side by side.
pub(crate) struct Pixels<T> {
    color: [T; 3],
    coverage: T,
    z: T,
    /// 1 where a face contains the pixel's center, else 0.
    hit: T,
    color_rows: [TwistRow<T>; 3],
    coverage_row: TwistRow<T>,
    z_row: TwistRow<T>,
}

#[inline(always)]
fn lane<const N: usize, T: Number>(values: &[T; N], lane: usize) -> [f32; N] {
    let mut out = [0.0; N];
    for i in 0..N {
        out[i] = values[i].lanes()[lane];
    }
    out
}

impl<T: Number> Pixels<T> {
    #[inline(always)]
    pub(crate) fn seen<const DERIVATIVES: bool>(&self, at: usize) -> Seen {
        let hit = self.hit.lanes()[at] > 0.0;
        let mut pixel = Pixel {
            color: lane(&self.color, at),
            coverage: self.coverage.lanes()[at],
            z: self.z.lanes()[at],
            depth_weight: if hit { 1.0 } else { 0.0 },
            ..Pixel::default()
        };
        if DERIVATIVES {
            for k in 0..3 {
                pixel.color_rows[k] = lane(&self.color_rows[k], at);
            }
            pixel.coverage_row = lane(&self.coverage_row, at);
            pixel.z_row = lane(&self.z_row, at);
        }
        Seen { pixel, hit, near_outline: !hit }
    }
}

impl SoftScene<'_> {
    /// The pixels of `run`, from (column, row) on. Leaves each fragment's share of the color in the weight of its part.
    #[inline(always)]
    pub(crate) fn pixels<const DERIVATIVES: bool, T: Number>(
        &self,
        run: &mut Run<T>,
        column: usize,
        row: usize,
    ) -> Pixels<T> {
        let zero = run.zero();
        let is = |value: f32| zero.like(value);
        let one = is(1.0);
        let blend = Blend::new(&mut run.candidates, &self.settings, zero);
        let mut color = [zero; 3];
        for candidate in &mut run.candidates {
            let share = candidate.part.weight * blend.inverse_sum;
            let share = T::pick(is(LEAST_SHARE).below(share), share, zero);
            candidate.part.weight = share;
            if !zero.any(zero.below(share)) {
                continue;
            }
            let id = self.ids[candidate.face as usize] as usize;
            let lit = Lit::new(&self.posed, &self.lighting, id, candidate.fragment.b);
            for k in 0..3 {
                color[k] = color[k] + share * lit.color[k];
            }
        }
        let hit = run.inside_z.below(is(f32::INFINITY));
        let mut pixels = Pixels {
            color,
            coverage: one - blend.clear,
            z: T::pick(hit, run.inside_z, blend.nearest),
            hit: T::pick(hit, one, zero),
            color_rows: [[zero; 6]; 3],
            coverage_row: [zero; 6],
            z_row: [zero; 6],
        };
        if DERIVATIVES {
            let (column, row) = places(zero, column, row);
            self.rows(run, &blend, column, row, &mut pixels);
        }
        pixels
    }

    #[inline(always)]
    fn motion(&self, face: u32) -> &FaceMotion {
        self.motions[face as usize].get_or_init(|| {
            let corners = self.posed.model.faces[self.ids[face as usize] as usize]
                .map(|v| self.screen[v as usize]);
            let center = &self.twist_center.coords;
            FaceMotion::new(&self.faces[face as usize], corners, &self.camera, center)
        })
    }

    /// Rows of color, coverage and depth, from each fragment's share of the color (in the weight of its part).
    ///
    /// With the shares ω = w/D, dC = Σ ω (dC_k + (C_k − C) d ln w_k), d ln w = −(1 − p)/σ dd − dz/(γ (z_far − z_near)),
    /// and dα = −(1 − α) Σ p/σ dd.
    #[inline(always)]
    fn rows<T: Number>(
        &self,
        run: &Run<T>,
        blend: &Blend<T>,
        column: T,
        row: T,
        pixels: &mut Pixels<T>,
    ) {
        let is = |value: f32| column.like(value);
        let (zero, one) = (is(0.0), is(1.0));
        let settings = &self.settings;
        let (focal, principal) = (self.posed.focal, self.posed.principal);
        let focal = [is(focal[0]), is(focal[1])];
        let center = single(&self.twist_center.coords);
        let ray = Ray {
            direction: [
                (column - is(principal[0])) / focal[0],
                (row - is(principal[1])) / focal[1],
                one,
            ],
            center: [is(center.x), is(center.y), is(center.z)],
            focal,
        };
        let mut color_sums = [RowSum::new(zero); 3];
        let (mut coverage_sum, mut z_sum) = (RowSum::new(zero), RowSum::new(zero));
        let (mut turning, mut level) = ([[zero; 3]; 3], [zero; 3]);
        // The nearest depth is what the weights are relative to; the background's weight is not if it is at its bound.
        let mut relative =
            blend.drifting * is(settings.depth_rate) * blend.background * blend.inverse_sum;
        for (place, candidate) in run.candidates.iter().enumerate() {
            let part = &candidate.part;
            let (face, fragment) = (&self.faces[candidate.face as usize], &candidate.fragment);
            let motion = self.motion(candidate.face);
            let mean_z = fragment.z * fragment.sum_active;
            // Where the sum is free, a depth that is the same everywhere moves with no coordinate; taking it off saves
            // digits.
            let depths = [is(face.z[0]) - mean_z, is(face.z[1]) - mean_z, is(face.z[2]) - mean_z];
            let at_center = run.inside.at_least(is(place as f32))
                & is(place as f32).at_least(run.inside)
                & run.inside_z.below(is(f32::INFINITY));
            if zero.any(at_center) {
                let by_z = T::pick(at_center, one, zero);
                let along = [by_z * depths[0], by_z * depths[1], by_z * depths[2]];
                let by_weight = fragment.weight_adjoint(along);
                z_sum.add_surface(motion, face, fragment, settings.perspective, by_z, by_weight);
            }
            let share = part.weight;
            let cover = blend.clear * part.presence;
            let (shown, covers) =
                (zero.any(zero.below(share)), zero.any(is(LEAST_SHARE).below(cover)));
            if !shown && !covers {
                continue;
            }
            let distance_row = ray.distance_row(face, fragment);
            if covers {
                coverage_sum.add_distance(cover * is(-settings.sharpness), &distance_row);
            }
            if !shown {
                continue;
            }
            let id = self.ids[candidate.face as usize] as usize;
            let lit = Lit::new(&self.posed, &self.lighting, id, fragment.b);
            let by_distance = part.absence * share * is(-settings.sharpness);
            let by_depth = share * is(-settings.depth_rate);
            let nearest = zero.below(candidate.counts) & blend.nearest.at_least(fragment.z);
            let drift = T::pick(nearest, relative, zero);
            relative = T::pick(nearest, zero, relative);
            for k in 0..3 {
                let contrast = lit.color[k] - pixels.color[k];
                let by_z = by_depth * contrast + drift * pixels.color[k];
                let along = [
                    by_z * depths[0],
                    by_z * depths[1] + share * lit.along[0][k],
                    by_z * depths[2] + share * lit.along[1][k],
                ];
                let by_weight = fragment.weight_adjoint(along);
                let sum = &mut color_sums[k];
                sum.add_distance(by_distance * contrast, &distance_row);
                sum.add_surface(motion, face, fragment, settings.perspective, by_z, by_weight);
                let turn = share * lit.turning[k];
                for n in 0..3 {
                    turning[k][n] = turning[k][n] + turn * lit.normal[n];
                }
                level[k] = level[k] + share * lit.level[k];
            }
        }
        pixels.coverage_row = coverage_sum.row(&ray);
        pixels.z_row = z_sum.row(&ray);
        let arm = self.posed.center - center;
        for k in 0..3 {
            // A turn of the normals under the light, n × light.
            let normals = turning[k];
            let mut in_camera = [zero; 3];
            for n in 0..3 {
                let axis = self.lighting.rotation.row(n);
                in_camera[n] =
                    normals[0] * is(axis.x) + normals[1] * is(axis.y) + normals[2] * is(axis.z);
            }
            let light = self.lighting.camera[k];
            let turn = cross(in_camera, [is(light.x), is(light.y), is(light.z)]);
            let mut out = color_sums[k].row(&ray);
            for n in 0..3 {
                out[n + 3] = out[n + 3] + turn[n];
            }
            // The texture's level follows the depth of the model's center: (0, 0, 1) and center × (0, 0, 1).
            let level = level[k] * is(self.posed.level_dz);
            out[2] = out[2] + level;
            out[3] = out[3] + level * is(arm.y);
            out[4] = out[4] - level * is(arm.x);
            pixels.color_rows[k] = out;
        }
    }
}
