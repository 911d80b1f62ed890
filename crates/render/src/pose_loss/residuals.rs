//! Residuals of one pixel against the target, and their sums.

use super::options::LossOptions;
use super::pixel::{Seen, View};
use super::sums::Sums;
use super::target::Target;
use rayon::prelude::*;

/// Sums the residuals over all pixels of a view, block by block in parallel, added up in a fixed order.
pub(crate) fn sum<const DERIVATIVES: bool>(
    view: &impl View,
    options: &LossOptions,
    target: &Target,
) -> Sums {
    let last = view.right().wrapping_sub(1);
    let blocks: Vec<Sums> = (0..view.blocks())
        .into_par_iter()
        .map(|block| {
            let mut sums = Sums::new();
            view.visit::<DERIVATIVES>(block, |x, y, seen| {
                let at = y * target.camera.width + x;
                options.add::<DERIVATIVES>(&mut sums, target, at, seen);
                if DERIVATIVES && x == last {
                    sums.end_row();
                }
            });
            sums
        })
        .collect();
    let mut total = Sums::new();
    blocks.iter().for_each(|block| total.merge(block));
    total
}

impl LossOptions {
    /// Adds the cost of a pixel of the mask that shows nothing of the object.
    fn miss(&self, sums: &mut Sums, observed: [f32; 3], coverage: f32) {
        let weight = self.color_weight;
        observed.iter().for_each(|c| sums.color += weight * self.robust.cost(*c).0 as f64);
        sums.mask += self.mask_weight * (coverage * coverage) as f64;
    }

    /// Adds the residuals of one pixel.
    #[inline]
    fn add<const DERIVATIVES: bool>(
        &self,
        sums: &mut Sums,
        target: &Target,
        at: usize,
        seen: Option<Seen>,
    ) {
        let (observed, coverage) = (target.color[at], target.coverage[at]);
        let (color_weight, mask_weight) = (self.color_weight as f32, self.mask_weight as f32);
        let Some(Seen { pixel, hit, near_outline }) = seen else {
            if coverage > 0.0 {
                self.miss(sums, observed, coverage);
                sums.counts.missed += 1;
            }
            return;
        };
        if target.hides(at, pixel.z) {
            sums.counts.hidden += 1;
            if self.hidden_is_missed && coverage > 0.0 {
                self.miss(sums, observed, coverage);
            }
            return;
        }
        sums.counts.covered += usize::from(hit);
        sums.counts.contour += usize::from(near_outline);
        if color_weight > 0.0 {
            for ((color, observed), row) in pixel.color.iter().zip(observed).zip(&pixel.color_rows)
            {
                let r = color - observed;
                let (cost, weight) = self.robust.cost(r);
                sums.color += (color_weight * cost) as f64;
                if DERIVATIVES {
                    sums.add(row, r, color_weight * weight);
                }
            }
        }
        if mask_weight > 0.0 {
            let r = pixel.coverage - coverage;
            sums.mask += (mask_weight * r * r) as f64;
            if DERIVATIVES && pixel.coverage < 1.0 {
                sums.add(&pixel.coverage_row, r, mask_weight);
            }
        }
        let (Some(options), Some(depth)) = (self.depth, &target.depth) else { return };
        let measured = depth.pixels()[at];
        if hit && measured > 0.0 {
            let scale = (1.0 / options.scale) as f32;
            let difference = pixel.z - measured;
            let limit = options.truncation as f32;
            let bounded = difference.max(-limit).min(limit);
            let r = pixel.depth_weight * bounded * scale;
            let weight = options.weight as f32;
            sums.depth += (weight * r * r) as f64;
            sums.counts.depth += 1;
            if DERIVATIVES {
                let along = if bounded == difference { pixel.depth_weight * scale } else { 0.0 };
                let mut row = pixel.z_row.map(|v| v * along);
                let fade = pixel.depth_weight_row;
                row.iter_mut().zip(fade).for_each(|(a, b)| *a += bounded * scale * b);
                sums.add(&row, r, weight);
            }
        }
    }
}

impl Target {
    /// Whether a known body lies in front of depth `z` \[m\] at pixel `at`.
    #[inline]
    pub(crate) fn hides(&self, at: usize, z: f32) -> bool {
        self.occluder.as_ref().is_some_and(|o| {
            let other = o.pixels()[at];
            other > 0.0 && other < z
        })
    }
}
