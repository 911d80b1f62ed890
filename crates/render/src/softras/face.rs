//! A projected face, ready to be compared with pixels.

use super::settings::Settings;

/// Corners of the edges that a distance is taken to; of equally near ones the first counts.
const EDGES: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];

/// A face in the image. Positions are relative to a pixel near it, so that f32 holds them well.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Face {
    /// The pixel (column, row) that positions are relative to: whole numbers.
    pub(crate) base: [f32; 2],
    /// Corners \[px\].
    pub(crate) corner: [[f32; 2]; 3],
    /// The edges from corner 0 to 1, 0 to 2 and 1 to 2 \[px\].
    pub(crate) edge: [[f32; 2]; 3],
    /// One over their squared lengths \[1/px²\], 0 for the very short.
    pub(crate) inverse_length: [f32; 3],
    /// 1 for the very short edges, which count as their second end, else 0.
    pub(crate) short: [f32; 3],
    /// Factors of the corners' edge functions in their weights: 1/Z with the perspective correction, 1 without; with the
    /// sign of the face's area, so that weights are positive inside.
    pub(crate) share: [f32; 3],
    /// One over the Z of the corners \[1/m\].
    pub(crate) inverse_z: [f32; 3],
    /// Z of the corners \[m\].
    pub(crate) z: [f32; 3],
    /// The weights' sum is taken to be at least this.
    pub(crate) least_sum: f32,
    /// Columns and rows at which the face may be kept: left, right, top, bottom \[px\].
    pub(crate) bounds: [f32; 4],
}

impl Face {
    /// True if the face may be kept at pixels of row `y`.
    #[inline(always)]
    pub(crate) fn touches_row(&self, y: usize) -> bool {
        let [.., top, bottom] = self.bounds;
        (top..=bottom).contains(&(y as f32))
    }

    /// The face with corners at (column, row, Z) \[px, m\]; none if it has no area in the image.
    pub(crate) fn new(corners: [[f64; 3]; 3], settings: &Settings) -> Option<Self> {
        let [a, b, c] = corners;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        // Also leaves out what is not a number.
        if !(area.abs() > settings.least_area && area.is_finite()) {
            return None;
        }
        let base = [a[0].round(), a[1].round()];
        let edge =
            EDGES.map(|[i, j]| [corners[j][0] - corners[i][0], corners[j][1] - corners[i][1]]);
        let length = edge.map(|e| e[0] * e[0] + e[1] * e[1]);
        let is_short = length.map(|l| l <= settings.least_edge);
        let share = corners.map(|c| if settings.perspective { 1.0 / c[2] } else { 1.0 });
        let sign = area.signum();
        let low = |k: usize| a[k].min(b[k]).min(c[k]) - settings.reach as f64;
        let high = |k: usize| a[k].max(b[k]).max(c[k]) + settings.reach as f64;
        let least_sum = settings.least_share * share[0] * share[1] * share[2] * area.abs();
        Some(Self {
            base: base.map(|v| v as f32),
            corner: corners.map(|c| [0, 1].map(|k| (c[k] - base[k]) as f32)),
            edge: edge.map(|e| e.map(|v| v as f32)),
            inverse_length: [0, 1, 2]
                .map(|i| if is_short[i] { 0.0 } else { 1.0 / length[i] as f32 }),
            short: is_short.map(|s| if s { 1.0 } else { 0.0 }),
            share: share.map(|s| (sign * s) as f32),
            inverse_z: corners.map(|c| (1.0 / c[2]) as f32),
            z: corners.map(|c| c[2] as f32),
            least_sum: least_sum as f32,
            bounds: [low(0), high(0), low(1), high(1)].map(|v| v as f32),
        })
    }
}
