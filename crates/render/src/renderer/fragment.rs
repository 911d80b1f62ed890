//! A face as seen from a pixel in the SoftRas mode, and the reverse derivatives, in f64.

use crate::softras::Settings;

/// Corners of the edges that a distance is taken to; of equally near ones the first counts.
const EDGES: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];

/// Fragment as in the loss of a pose ([`crate::softras`] has the formulas).
#[derive(Clone, Copy, Debug)]
pub(super) struct Fragment {
    /// Barycentric coordinates of the surface point.
    pub(super) b: [f64; 3],
    /// Σ b_i Z_i \[m\].
    pub(super) z: f64,
    /// Squared distance to the nearest of the three edges \[px²\], negative inside.
    pub(super) distance: f64,
    /// Corners: from the pixel \[px\], and Z \[m\].
    corner: [[f64; 2]; 3],
    depth: [f64; 3],
    perspective: bool,
    /// Factors of the edge functions in their weights, and the weights before clamping.
    share: [f64; 3],
    weight: [f64; 3],
    least_weight: f64,
    /// Sum of the clamped weights, and whether it is above its lower bound.
    sum: f64,
    sum_is_free: bool,
    /// Barycentric coordinates, in the image, of the nearest point on the edges, and where it is from the pixel \[px\].
    foot: [f64; 3],
    to_foot: [f64; 2],
}

#[inline]
fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

impl Fragment {
    /// Fragment of the face with corners at (column, row, Z) \[px, m\], at a pixel (column, row).
    #[inline]
    pub(super) fn new(corners: &[[f64; 3]; 3], pixel: [f64; 2], settings: &Settings) -> Self {
        let corner = corners.map(|c| [c[0] - pixel[0], c[1] - pixel[1]]);
        let depth = corners.map(|c| c[2]);
        let [p, q, r] = corner;
        let area = cross([q[0] - p[0], q[1] - p[1]], [r[0] - p[0], r[1] - p[1]]);
        let scale = depth.map(|z| if settings.perspective { 1.0 / z } else { 1.0 });
        let share = scale.map(|s| area.signum() * s);
        let weight = [share[0] * cross(q, r), share[1] * cross(r, p), share[2] * cross(p, q)];
        let inside = weight.iter().all(|w| *w > 0.0);
        let least_weight = f64::from(settings.least_weight);
        let clamped = weight.map(|w| w.max(least_weight));
        let least_sum = settings.least_share * scale[0] * scale[1] * scale[2] * area.abs();
        let sum = clamped[0] + clamped[1] + clamped[2];
        let sum_is_free = sum > least_sum;
        let sum = if sum_is_free { sum } else { least_sum };
        let b = clamped.map(|w| w / sum);
        let (mut squared, mut foot, mut to_foot) = (f64::INFINITY, [0.0; 3], [0.0; 2]);
        for [i, j] in EDGES {
            let (start, end) = (corner[i], corner[j]);
            let d = [end[0] - start[0], end[1] - start[1]];
            let length = d[0] * d[0] + d[1] * d[1];
            let free = -(start[0] * d[0] + start[1] * d[1]) / length;
            let t = if length > settings.least_edge { free.clamp(0.0, 1.0) } else { 1.0 };
            let offset = [start[0] + t * d[0], start[1] + t * d[1]];
            let candidate = offset[0] * offset[0] + offset[1] * offset[1];
            if candidate < squared {
                (squared, to_foot, foot) = (candidate, offset, [0.0; 3]);
                (foot[i], foot[j]) = (1.0 - t, t);
            }
        }
        Self {
            b,
            z: (0..3).map(|i| b[i] * depth[i]).sum(),
            distance: if inside { -squared } else { squared },
            corner,
            depth,
            perspective: settings.perspective,
            share,
            weight,
            least_weight,
            sum,
            sum_is_free,
            foot,
            to_foot,
        }
    }

    /// From derivatives by barycentric coordinates, depth \[1/m\] and distance \[1/px²\] to those by columns, rows \[1/px\]
    /// and depths \[1/m\] of the corners; at kinks, of one side.
    ///
    /// With b_i = W_i / Σ W_j and W_i = s_i E_i: W̄_i = (ā_i − Σ b_j ā_j) / Σ W_j for ā_i = b̄_i + z̄ Z_i, E_i = v_j × v_k, and
    /// s = 1/Z falls by s/Z.
    #[inline]
    pub(super) fn pull_back(&self, by_b: [f64; 3], by_z: f64, by_distance: f64) -> [[f64; 3]; 3] {
        let along = [0, 1, 2].map(|i| by_b[i] + by_z * self.depth[i]);
        let mean = match self.sum_is_free {
            true => self.b[0] * along[0] + self.b[1] * along[1] + self.b[2] * along[2],
            false => 0.0,
        };
        let reach = if self.distance < 0.0 { -2.0 * by_distance } else { 2.0 * by_distance };
        let mut out = [[0.0; 3]; 3];
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let free = self.weight[i] >= self.least_weight;
            let by_weight = if free { (along[i] - mean) / self.sum } else { 0.0 };
            let by_edge = by_weight * self.share[i];
            let (v_j, v_k) = (self.corner[j], self.corner[k]);
            out[j][0] += by_edge * v_k[1];
            out[j][1] -= by_edge * v_k[0];
            out[k][0] -= by_edge * v_j[1];
            out[k][1] += by_edge * v_j[0];
            out[i][0] += reach * self.to_foot[0] * self.foot[i];
            out[i][1] += reach * self.to_foot[1] * self.foot[i];
            out[i][2] += by_z * self.b[i];
            if self.perspective {
                out[i][2] -= by_weight * self.weight[i] / self.depth[i];
            }
        }
        out
    }

    /// Which sides of the kinks the fragment is on: its smooth function is another for each.
    #[cfg(test)]
    pub(super) fn branches(&self) -> u32 {
        let bits = [
            self.weight.map(|w| w > 0.0),
            self.foot.map(|f| f > 0.0),
            [self.sum_is_free, self.distance < 0.0, false],
        ];
        bits.as_flattened().iter().fold(0, |all, bit| 2 * all + u32::from(*bit))
    }
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::check::finite_difference_gradient;

    use super::*;
    use crate::camera::Camera;
    use crate::mode::SoftRasOptions;

    /// Inside, beside an edge, beside a corner, beyond the line of an edge; with each pair of options.
    #[test]
    fn derivatives_match_differences_of_the_values() {
        let camera = Camera { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, width: 64, height: 64 };
        let corners = [3.0, 4.0, 0.5, 9.0, 5.5, 0.6, 5.0, 11.0, 0.45];
        let triangle = |x: &[f64]| [0, 3, 6].map(|i| [x[i], x[i + 1], x[i + 2]]);
        for (perspective_correct, clip_barycentric) in
            [(false, false), (false, true), (true, false), (true, true)]
        {
            let options = SoftRasOptions {
                perspective_correct,
                clip_barycentric,
                ..SoftRasOptions::default()
            };
            let settings = Settings::new(&options, &camera);
            for pixel in [[6.0, 7.0], [5.0, 4.1], [7.0, 3.0], [1.0, 2.0], [9.0, 9.0]] {
                let value = |x: &[f64]| {
                    let f = Fragment::new(&triangle(x), pixel, &settings);
                    0.3 * f.b[0] - 0.8 * f.b[1] + 0.2 * f.b[2] + 2.0 * f.z + 0.1 * f.distance
                };
                for x in [corners, [0, 1, 2, 6, 7, 8, 3, 4, 5].map(|i| corners[i])] {
                    let fragment = Fragment::new(&triangle(&x), pixel, &settings);
                    let exact = fragment.pull_back([0.3, -0.8, 0.2], 2.0, 0.1);
                    let differences = finite_difference_gradient(value, &x, 1e-6);
                    for (a, b) in exact.as_flattened().iter().zip(&differences) {
                        assert!((a - b).abs() < 1e-6, "{pixel:?} {exact:?} {differences:?}");
                    }
                }
            }
        }
    }
}
