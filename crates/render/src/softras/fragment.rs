//! What a face looks like from a pixel.

use super::face::{EDGES, Face};
use super::settings::Settings;

/// A face as seen from a pixel centre p.
///
/// With the corners v_i relative to p, the edge functions are E_0 = v_1 × v_2, E_1 = v_2 × v_0 and E_2 = v_0 × v_1
/// (positive inside), the weights W_i = s_i E_i with s_i = 1/Z_i if the perspective is corrected and s_i = 1 if not,
/// clamped to zero from below if coordinates are clipped, and b_i = W_i / Σ W_j.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Fragment {
    /// Barycentric coordinates of the surface point.
    pub(crate) b: [f32; 3],
    /// Σ b_i Z_i \[m\].
    pub(crate) z: f32,
    /// Squared distance to the nearest of the three edges \[px²\], negative inside.
    pub(crate) distance: f32,
    /// Barycentric coordinates, in the image, of the nearest point on the edges.
    pub(crate) foot: [f32; 3],
    /// From the pixel centre to that point \[px\].
    pub(crate) to_foot: [f32; 2],
    /// One over the sum of the weights.
    pub(crate) inverse_sum: f32,
    /// 1 where the weight depends on the corners, 0 where it is clamped.
    pub(crate) active: [f32; 3],
    /// 1 where the sum of the weights does, 0 where it is at its lower bound.
    pub(crate) sum_active: f32,
    /// The pixel centre lies inside the face.
    pub(crate) inside: bool,
    /// The face counts at this pixel.
    pub(crate) kept: bool,
}

#[inline(always)]
fn pick(condition: bool, yes: f32, no: f32) -> f32 {
    if condition { yes } else { no }
}

#[inline(always)]
fn cross(a: [f32; 2], b: [f32; 2]) -> f32 {
    a[0] * b[1] - a[1] * b[0]
}

impl Fragment {
    /// The fragment of `face` at pixel (column, row). Written without branches, so that a loop over pixels or faces becomes
    /// vector instructions.
    #[inline(always)]
    pub(crate) fn new(face: &Face, column: f32, row: f32, settings: &Settings) -> Self {
        // Exact: both are whole numbers.
        let (x, y) = (column - face.base[0], row - face.base[1]);
        let v = [0, 1, 2].map(|i| [face.corner[i][0] - x, face.corner[i][1] - y]);
        let raw = [
            face.share[0] * cross(v[1], v[2]),
            face.share[1] * cross(v[2], v[0]),
            face.share[2] * cross(v[0], v[1]),
        ];
        let inside = (raw[0] > 0.0) & (raw[1] > 0.0) & (raw[2] > 0.0);
        let least = settings.least_weight;
        let active = raw.map(|w| pick(w >= least, 1.0, 0.0));
        let weight = raw.map(|w| pick(w >= least, w, least));
        let sum = weight[0] + weight[1] + weight[2];
        let sum_active = pick(sum > face.least_sum, 1.0, 0.0);
        let sum = pick(sum > face.least_sum, sum, face.least_sum);
        // A division, so that a point clamped to a corner has its coordinates and depth exactly: ties between the faces
        // around a corner stay ties.
        let b = weight.map(|w| w / sum);
        let z = b[0] * face.z[0] + b[1] * face.z[1] + b[2] * face.z[2];

        let (mut squared, mut foot, mut to_foot) = (f32::INFINITY, [0.0; 3], [0.0; 2]);
        for (e, [i, j]) in EDGES.into_iter().enumerate() {
            let d = face.edge[e];
            let t = face.short[e] - (v[i][0] * d[0] + v[i][1] * d[1]) * face.inverse_length[e];
            let t = pick(t > 0.0, t, 0.0);
            let t = pick(t < 1.0, t, 1.0);
            let offset = [v[i][0] + t * d[0], v[i][1] + t * d[1]];
            let length = offset[0] * offset[0] + offset[1] * offset[1];
            let nearer = length < squared;
            let mut at = [0.0; 3];
            at[i] = 1.0 - t;
            at[j] = t;
            squared = pick(nearer, length, squared);
            foot = [0, 1, 2].map(|k| pick(nearer, at[k], foot[k]));
            to_foot = [0, 1].map(|k| pick(nearer, offset[k], to_foot[k]));
        }
        Self {
            b,
            z,
            distance: pick(inside, -squared, squared),
            foot,
            to_foot,
            inverse_sum: 1.0 / sum,
            active,
            sum_active,
            inside,
            kept: (inside | (squared < settings.blur)) & (z >= 0.0),
        }
    }
}
