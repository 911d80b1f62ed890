//! Pixels at inner contours, which show two surfaces.

use glam::Vec2;

use super::drawing::falling_step;
use super::footprint::Layers;
use super::inner::Inner;
use super::scene::ContourScene;
use crate::view::{Pixel, scaled_sum};

impl ContourScene<'_> {
    /// Blends the near and the far surface across an inner contour, at a pixel that shows `own`.
    ///
    /// On the far side the near surface has the color of the foot; on the near side the far surface has the
    /// color of the pixel beyond the contour.
    pub(super) fn cross<const DERIVATIVES: bool>(
        &self,
        at: Vec2,
        own: Pixel,
        inner: &Inner,
        layers: Option<&Layers>,
    ) -> Pixel {
        let foot = inner.piece.foot(at);
        let side = if own.z > inner.split { 1.0 } else { -1.0 };
        let (near, far) = if side > 0.0 {
            (self.at_foot::<DERIVATIVES>(&inner.piece, &foot), own)
        } else {
            let (beyond, face, inverse_z) = inner.behind;
            (own, self.interior::<DERIVATIVES>(beyond, face, inverse_z, None))
        };
        let distance = foot.distance_squared.sqrt();
        let step = self.drawing.step;
        let (alpha, slope) = step.at(side * distance, inner.piece.outward);
        // Depth counts for nothing at the step itself.
        let (weight, weight_derivative) = falling_step(step.reach() - 2.0 * distance, step.reach());
        let mut out = own;
        for k in 0..3 {
            out.color[k] = alpha * near.color[k] + (1.0 - alpha) * far.color[k];
        }
        out.depth_weight = weight;
        if DERIVATIVES {
            let ds = self.distance_row(&inner.piece, &foot, side);
            for k in 0..3 {
                let mixed = scaled_sum(alpha, &near.color_rows[k], 1.0 - alpha, &far.color_rows[k]);
                let step = slope * (near.color[k] - far.color[k]);
                out.color_rows[k] = scaled_sum(1.0, &mixed, step, &ds);
            }
            if let Some(layers) = layers {
                out.color_rows = self.rows_across(at, inner, &foot, side, layers, &ds);
            }
            out.depth_weight_row = ds.map(|v| -2.0 * side * weight_derivative * v);
        }
        out
    }
}
