//! What a face looks like from a pixel.

use super::face::Face;
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

/// The point of an edge that is nearest to a pixel.
#[derive(Clone, Copy)]
struct Foot {
    /// Share of the edge.
    share: f32,
    /// From the pixel \[px\].
    offset: [f32; 2],
    squared: f32,
}

impl Foot {
    #[inline(always)]
    fn or(self, other_instead: bool, other: Self) -> Self {
        Self {
            share: pick(other_instead, other.share, self.share),
            offset: [
                pick(other_instead, other.offset[0], self.offset[0]),
                pick(other_instead, other.offset[1], self.offset[1]),
            ],
            squared: pick(other_instead, other.squared, self.squared),
        }
    }
}

impl Face {
    /// On edge `edge`, whose first end lies at `start` from the pixel.
    #[inline(always)]
    fn foot(&self, edge: usize, start: [f32; 2]) -> Foot {
        let d = self.edge[edge];
        let t = self.short[edge] - (start[0] * d[0] + start[1] * d[1]) * self.inverse_length[edge];
        let t = pick(t > 0.0, t, 0.0);
        let share = pick(t < 1.0, t, 1.0);
        let offset = [start[0] + share * d[0], start[1] + share * d[1]];
        Foot { share, offset, squared: offset[0] * offset[0] + offset[1] * offset[1] }
    }
}

impl Fragment {
    /// The fragment of `face` at pixel (column, row). Written without branches, so that a loop over pixels or faces becomes
    /// vector instructions.
    #[inline(always)]
    pub(crate) fn new(face: &Face, column: f32, row: f32, settings: &Settings) -> Self {
        // Exact: both are whole numbers. Arrays are written out: `map` is a call that keeps loops from becoming vectors.
        let (x, y) = (column - face.base[0], row - face.base[1]);
        let [c0, c1, c2] = &face.corner;
        let (v0, v1, v2) = ([c0[0] - x, c0[1] - y], [c1[0] - x, c1[1] - y], [c2[0] - x, c2[1] - y]);
        let raw0 = face.share[0] * cross(v1, v2);
        let raw1 = face.share[1] * cross(v2, v0);
        let raw2 = face.share[2] * cross(v0, v1);
        let inside = (raw0 > 0.0) & (raw1 > 0.0) & (raw2 > 0.0);
        let least = settings.least_weight;
        let w0 = pick(raw0 >= least, raw0, least);
        let w1 = pick(raw1 >= least, raw1, least);
        let w2 = pick(raw2 >= least, raw2, least);
        let sum = w0 + w1 + w2;
        let sum_active = pick(sum > face.least_sum, 1.0, 0.0);
        let sum = pick(sum > face.least_sum, sum, face.least_sum);
        // Divisions, so that a point clamped to a corner has its coordinates and depth exactly: ties between the faces
        // around a corner stay ties.
        let b = [w0 / sum, w1 / sum, w2 / sum];
        let z = b[0] * face.z[0] + b[1] * face.z[1] + b[2] * face.z[2];

        let [first, second, third] = [face.foot(0, v0), face.foot(1, v0), face.foot(2, v1)];
        let (t, u) = (first.share, 1.0 - first.share);
        let (mut foot, mut near) = ([u, t, 0.0], first);
        let (t, u, nearer) = (second.share, 1.0 - second.share, second.squared < near.squared);
        foot = [pick(nearer, u, foot[0]), pick(nearer, 0.0, foot[1]), pick(nearer, t, foot[2])];
        near = near.or(nearer, second);
        let (t, u, nearer) = (third.share, 1.0 - third.share, third.squared < near.squared);
        foot = [pick(nearer, 0.0, foot[0]), pick(nearer, u, foot[1]), pick(nearer, t, foot[2])];
        near = near.or(nearer, third);
        let squared = near.squared;
        Self {
            b,
            z,
            distance: pick(inside, -squared, squared),
            foot,
            to_foot: near.offset,
            inverse_sum: 1.0 / sum,
            active: [
                pick(raw0 >= least, 1.0, 0.0),
                pick(raw1 >= least, 1.0, 0.0),
                pick(raw2 >= least, 1.0, 0.0),
            ],
            sum_active,
            inside,
            kept: (inside | (squared < settings.blur)) & (z >= 0.0),
        }
    }
}
