//! Derivatives of a projected face by the twist of the pose.

use nalgebra::Vector3;

use super::face::Face;

/// A derivative by the twist (translation, rotation), padded for vector instructions.
pub(crate) type WideRow = [f32; 8];

/// `sum += factor row`.
#[inline(always)]
pub(crate) fn add_scaled(sum: &mut WideRow, factor: f32, row: &WideRow) {
    for i in 0..8 {
        sum[i] += factor * row[i];
    }
}

/// The rows of a face's corners, and those of the weights of all its fragments.
#[derive(Clone, Debug)]
pub(crate) struct FaceRows {
    /// Of each corner's column and row \[px\].
    image: [[WideRow; 2]; 3],
    /// Of each corner's Z.
    depth: [WideRow; 3],
    /// A weight W_i is linear in the pixel's position, and so is its row: value at the face's base, slope along
    /// columns, slope along rows.
    weight: [[WideRow; 3]; 3],
}

impl FaceRows {
    /// For the corners `points` (camera frame \[m\]) of `face`, focal lengths `focal` \[px\] and twists about `center`.
    pub(crate) fn new(
        face: &Face,
        points: [Vector3<f32>; 3],
        focal: [f32; 2],
        center: &Vector3<f32>,
        perspective: bool,
    ) -> Self {
        // A point moves by t + ω × (X − c), so that a gradient g by the point gives (g, (X − c) × g).
        let row = |i: usize, g: Vector3<f32>| {
            let turn = (points[i] - center).cross(&g);
            [g.x, g.y, g.z, turn.x, turn.y, turn.z, 0.0, 0.0]
        };
        let image = [0, 1, 2].map(|i| {
            let p = points[i];
            let (x, y) = (focal[0] / p.z, focal[1] / p.z);
            [
                row(i, Vector3::new(x, 0.0, -x * p.x / p.z)),
                row(i, Vector3::new(0.0, y, -y * p.y / p.z)),
            ]
        });
        let depth = [0, 1, 2].map(|i| row(i, Vector3::z()));
        let weight = [0, 1, 2].map(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let ([p, q], s) = ([face.corner[j], face.corner[k]], face.share[i]);
            let ([du_j, dv_j], [du_k, dv_k]) = (&image[j], &image[k]);
            // E_i = (v_j − x) × (v_k − x) = v_j × v_k − x × (v_k − v_j).
            let edge = [p[0] * q[1] - p[1] * q[0], p[1] - q[1], q[0] - p[0]];
            let mut rows = [[0.0; 8]; 3];
            for n in 0..6 {
                rows[0][n] =
                    s * (du_j[n] * q[1] - dv_j[n] * q[0] + p[0] * dv_k[n] - p[1] * du_k[n]);
                rows[1][n] = s * (dv_j[n] - dv_k[n]);
                rows[2][n] = s * (du_k[n] - du_j[n]);
                if perspective {
                    let ds = -s / face.z[i] * depth[i][n];
                    (0..3).for_each(|m| rows[m][n] += ds * edge[m]);
                }
            }
            rows
        });
        Self { image, depth, weight }
    }

    /// Adds the row of Σ f_i u_i x + f_i v_i y for a foot with coordinates f and a direction (x, y).
    #[inline(always)]
    pub(crate) fn add_image(&self, sum: &mut WideRow, direction: [f32; 2], foot: [f32; 3]) {
        for (share, [column, row]) in foot.iter().zip(&self.image) {
            add_scaled(sum, direction[0] * share, column);
            add_scaled(sum, direction[1] * share, row);
        }
    }

    /// The row of Σ b_i Z_i at fixed b.
    #[inline(always)]
    pub(crate) fn depth(&self, b: [f32; 3]) -> WideRow {
        let mut out = [0.0; 8];
        (0..3).for_each(|i| add_scaled(&mut out, b[i], &self.depth[i]));
        out
    }

    /// The rows of the weights W_i at the pixel (x, y), relative to the face's base.
    #[inline(always)]
    pub(crate) fn weights(&self, x: f32, y: f32) -> [WideRow; 3] {
        let mut out = [[0.0; 8]; 3];
        for (out, [base, along, down]) in out.iter_mut().zip(&self.weight) {
            for n in 0..8 {
                out[n] = base[n] + x * along[n] + y * down[n];
            }
        }
        out
    }
}
