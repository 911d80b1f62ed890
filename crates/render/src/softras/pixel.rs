//! What a pixel shows, and its derivatives by the pose.

use std::sync::OnceLock;

use nalgebra::Vector3;

use super::blend::{Blend, Part};
use super::face::Face;
use super::fragment::Fragment;
use super::rows::{FaceRows, WideRow, add_scaled};
use super::settings::Settings;
use crate::contour::{Lighting, Shaded, posed_normal, shade};
use crate::mode::SoftRasOptions;
use crate::pose_loss::{Pixel, Row, Seen};
use crate::posed::Posed;

/// What has a smaller share of the pixel is left out: 64 such fragments are less than 1e-6 of its colour.
pub(crate) const LEAST_SHARE: f32 = 1e-8;

const MOST: usize = SoftRasOptions::MOST_FACES;

/// A posed, lit model with the faces that are drawn, and the point about which twists turn (camera frame).
pub(crate) struct Scene<'a> {
    pub(crate) posed: Posed<'a>,
    pub(crate) lighting: Lighting,
    pub(crate) settings: Settings,
    pub(crate) faces: Vec<Face>,
    /// The model's index of each of them.
    pub(crate) ids: Vec<u32>,
    /// The derivatives of those that are seen.
    pub(crate) rows: Vec<OnceLock<FaceRows>>,
    pub(crate) twist_center: Vector3<f32>,
}

/// The fragments of the pixel at hand. Reused, because clearing it takes as long as filling it.
pub(crate) struct Scratch {
    faces: [u32; MOST],
    fragments: [Fragment; MOST],
    parts: [Part; MOST],
    shaded: [Shaded; MOST],
}

impl Scratch {
    pub(crate) fn new() -> Self {
        Self {
            faces: [0; MOST],
            fragments: [Fragment::default(); MOST],
            parts: [Part::default(); MOST],
            shaded: [Shaded::default(); MOST],
        }
    }
}

#[inline(always)]
fn narrow([a, b, c, d, e, f, _, _]: &WideRow) -> Row {
    [*a, *b, *c, *d, *e, *f]
}

impl Scene<'_> {
    /// Pixel (column, row) that shows `faces`, not none of them; `inside` is the nearest that contains its centre.
    #[inline(always)]
    pub(crate) fn pixel<const DERIVATIVES: bool>(
        &self,
        scratch: &mut Scratch,
        column: f32,
        row: f32,
        faces: impl Iterator<Item = u32>,
        inside: Option<u32>,
    ) -> Seen {
        let settings = &self.settings;
        let mut count = 0;
        for face in faces.take(MOST) {
            scratch.faces[count] = face;
            scratch.fragments[count] =
                Fragment::new(&self.faces[face as usize], column, row, settings);
            count += 1;
        }
        let blend = Blend::new(&scratch.fragments[..count], &mut scratch.parts, settings);
        let inverse_sum = 1.0 / blend.sum;
        let mut pixel = Pixel { coverage: 1.0 - blend.clear, z: blend.nearest, ..Pixel::default() };
        for i in 0..count {
            let share = scratch.parts[i].weight * inverse_sum;
            if share > LEAST_SHARE {
                let b = scratch.fragments[i].b;
                let id = self.ids[scratch.faces[i] as usize] as usize;
                let shaded = shade::<DERIVATIVES>(&self.posed, &self.lighting, id, b);
                (0..3).for_each(|k| pixel.color[k] += share * shaded.color[k]);
                scratch.shaded[i] = shaded;
            }
        }
        if DERIVATIVES {
            self.rows::<DERIVATIVES>(scratch, count, &blend, column, row, &mut pixel);
        }
        if let Some(face) = inside {
            self.depth::<DERIVATIVES>(face, column, row, &mut pixel);
        }
        Seen { pixel, hit: inside.is_some(), near_outline: inside.is_none() }
    }

    /// The unit normal (camera frame) of a face at a pixel inside it, and the model's index of the face.
    pub(crate) fn normal(&self, face: u32, column: f32, row: f32) -> (u32, [f32; 3]) {
        let b = Fragment::new(&self.faces[face as usize], column, row, &self.settings).b;
        let id = self.ids[face as usize];
        (id, posed_normal(&self.posed, id as usize, b))
    }

    /// The depth of the surface at a pixel inside a face.
    #[inline(always)]
    fn depth<const DERIVATIVES: bool>(&self, face: u32, column: f32, row: f32, pixel: &mut Pixel) {
        let geometry = &self.faces[face as usize];
        let fragment = Fragment::new(geometry, column, row, &self.settings);
        pixel.z = fragment.z;
        pixel.depth_weight = 1.0;
        if DERIVATIVES {
            let rows = self.face_rows(face);
            let mut out = rows.depth(fragment.b);
            let (x, y) = (column - geometry.base[0], row - geometry.base[1]);
            let level = fragment.z * fragment.sum_active;
            let weight = fragment.weight_adjoint(geometry.z.map(|z| z - level));
            for (weight, row) in weight.iter().zip(&rows.weights(x, y)) {
                add_scaled(&mut out, *weight, row);
            }
            pixel.z_row = narrow(&out);
        }
    }

    #[inline(always)]
    fn face_rows(&self, face: u32) -> &FaceRows {
        self.rows[face as usize].get_or_init(|| {
            let points = self.posed.model.faces[self.ids[face as usize] as usize]
                .map(|v| self.posed.position[v as usize]);
            let geometry = &self.faces[face as usize];
            let (focal, center) = (self.posed.focal, &self.twist_center);
            FaceRows::new(geometry, points, focal, center, self.settings.perspective)
        })
    }

    /// Rows of colour and coverage.
    ///
    /// With the shares ω = w/D, dC = Σ ω (dC_k + (C_k − C) d ln w_k), d ln w = −(1 − p)/σ dd − dz/(γ (z_far − z_near)),
    /// and dα = −(1 − α) Σ p/σ dd.
    #[inline(always)]
    fn rows<const DERIVATIVES: bool>(
        &self,
        scratch: &Scratch,
        count: usize,
        blend: &Blend,
        column: f32,
        row: f32,
        pixel: &mut Pixel,
    ) {
        let settings = &self.settings;
        let inverse_sum = 1.0 / blend.sum;
        let mut color_rows = [[0.0; 8]; 3];
        let mut coverage_row = [0.0; 8];
        let (mut turning, mut level) = ([[0.0; 3]; 3], [0.0; 3]);
        let mut drift = blend.drifting;
        for i in 0..count {
            let (part, fragment) = (&scratch.parts[i], &scratch.fragments[i]);
            let share = part.weight * inverse_sum;
            let cover = blend.clear * part.presence;
            if share <= LEAST_SHARE && cover <= LEAST_SHARE {
                continue;
            }
            let face = scratch.faces[i];
            let rows = self.face_rows(face);
            let mut distance_row = [0.0; 8];
            rows.add_image(&mut distance_row, fragment.distance_gradient(), fragment.foot);
            add_scaled(&mut coverage_row, -cover * settings.sharpness, &distance_row);
            if share <= LEAST_SHARE {
                continue;
            }
            let shaded = &scratch.shaded[i];
            let by_distance = -part.absence * settings.sharpness * share;
            let by_depth = -settings.depth_rate * share;
            // The nearest depth is what the weights are relative to; the background's weight is not if it is at its bound.
            let nearest = drift && fragment.z == blend.nearest;
            drift &= !nearest;
            let relative =
                if nearest { settings.depth_rate * blend.background * inverse_sum } else { 0.0 };
            let geometry = &self.faces[face as usize];
            let (x, y) = (column - geometry.base[0], row - geometry.base[1]);
            let weight_rows = rows.weights(x, y);
            let depth_row = rows.depth(fragment.b);
            let mean_z = fragment.z * fragment.sum_active;
            for k in 0..3 {
                let contrast = shaded.color[k] - pixel.color[k];
                let z = by_depth * contrast + relative * pixel.color[k];
                let along = [
                    z * (geometry.z[0] - mean_z),
                    z * (geometry.z[1] - mean_z) + share * shaded.along[0][k],
                    z * (geometry.z[2] - mean_z) + share * shaded.along[1][k],
                ];
                let weight = fragment.weight_adjoint(along);
                let distance = by_distance * contrast;
                let sum = &mut color_rows[k];
                for n in 0..8 {
                    sum[n] += weight[0] * weight_rows[0][n]
                        + weight[1] * weight_rows[1][n]
                        + weight[2] * weight_rows[2][n]
                        + z * depth_row[n]
                        + distance * distance_row[n];
                }
                (0..3).for_each(|n| turning[k][n] += shaded.turning[k][n] * share);
                level[k] += shaded.level[k] * share;
            }
        }
        let center = self.posed.center - self.twist_center;
        for k in 0..3 {
            let out = &mut pixel.color_rows[k];
            *out = narrow(&color_rows[k]);
            (0..3).for_each(|n| out[n + 3] += turning[k][n]);
            // The texture's level follows the depth of the model's centre: (0, 0, 1) and center × (0, 0, 1).
            let level = level[k] * self.posed.level_dz;
            out[2] += level;
            out[3] += level * center.y;
            out[4] -= level * center.x;
        }
        pixel.coverage_row = narrow(&coverage_row);
    }
}
