//! Residuals of pixels against the target, and their sums.

#![allow(clippy::needless_range_loop)] // loops over lanes index several arrays alike

use std::ops::Range;

use super::kernel;
use super::options::{DepthOptions, LossOptions};
use super::sums::{LaneSums, Sums};
use super::target::Target;
use crate::image::DepthImage;
use crate::view::{LANES, Patch, Seen};

/// Residuals of a view against the target.
#[derive(Clone, Copy)]
pub(super) struct Residuals<'a> {
    pub(super) options: &'a LossOptions,
    pub(super) target: &'a Target,
}

impl Residuals<'_> {
    /// Adds the cost of a pixel of the mask that shows nothing of the object.
    fn miss(&self, sums: &mut Sums, at: usize) {
        let coverage = self.target.coverage[at];
        for c in self.target.color[at] {
            let (loss, _) = kernel::loss_and_weight(self.options.kernel, c);
            sums.color += self.options.color_weight * loss as f64;
        }
        sums.mask += 0.5 * self.options.mask_weight * (coverage * coverage) as f64;
    }

    /// Whether a known body lies in front of depth `z` \[m\] at pixel `at`; if so, it is counted.
    #[inline]
    pub(super) fn hidden(&self, sums: &mut Sums, at: usize, z: f32) -> bool {
        if !self.target.hides(at, z) {
            return false;
        }
        sums.counts.hidden += 1;
        if self.options.penalize_occluded && self.target.coverage[at] > 0.0 {
            self.miss(sums, at);
        }
        true
    }

    /// Adds the residuals of pixel `at`.
    #[inline]
    pub(super) fn add<const DERIVATIVES: bool>(
        &self,
        sums: &mut Sums,
        at: usize,
        seen: Option<Seen>,
    ) {
        let Some(seen) = seen else { return self.add_nothing(sums, at) };
        if self.hidden(sums, at, seen.pixel.z) {
            return;
        }
        let options = self.options;
        let color_weight = options.color_weight as f32;
        let pixel = &seen.pixel;
        if color_weight > 0.0 {
            let observed = self.target.color[at];
            for k in 0..3 {
                let r = pixel.color[k] - observed[k];
                let (loss, weight) = kernel::loss_and_weight(options.kernel, r);
                sums.color += (color_weight * loss) as f64;
                if DERIVATIVES {
                    sums.add(&pixel.color_rows[k], r, color_weight * weight);
                }
            }
        }
        self.add_but_color::<DERIVATIVES>(sums, at, &seen);
    }

    /// True for each of these pixels that costs something if nothing of the object is seen there.
    #[inline]
    pub(super) fn missed_if_empty(&self, at: Range<usize>) -> impl Iterator<Item = bool> {
        self.target.coverage[at].iter().map(|coverage| *coverage > 0.0)
    }

    /// Adds the residuals of pixel `at`, where nothing of the object is seen.
    #[inline]
    pub(super) fn add_nothing(&self, sums: &mut Sums, at: usize) {
        if self.missed_if_empty(at..at + 1).any(|missed| missed) {
            self.miss(sums, at);
            sums.counts.missed += 1;
        }
    }

    /// Counts pixel `at`, which nothing hides, and adds all of its residuals but those of the color.
    #[inline]
    pub(super) fn add_but_color<const DERIVATIVES: bool>(
        &self,
        sums: &mut Sums,
        at: usize,
        Seen { pixel, hit, near_outline }: &Seen,
    ) {
        let options = self.options;
        let mask_weight = options.mask_weight as f32;
        sums.counts.covered += usize::from(*hit);
        sums.counts.contour += usize::from(*near_outline);
        if mask_weight > 0.0 {
            let r = pixel.coverage - self.target.coverage[at];
            sums.mask += (0.5 * mask_weight * r * r) as f64;
            if DERIVATIVES && pixel.coverage < 1.0 {
                sums.add(&pixel.coverage_row, r, mask_weight);
            }
        }
        let Some((options, depth)) = self.depth() else { return };
        let measured = depth.pixels()[at];
        if *hit && measured > 0.0 {
            let scale = (1.0 / options.scale) as f32;
            let difference = pixel.z - measured;
            let limit = options.truncation as f32;
            let bounded = difference.max(-limit).min(limit);
            let r = pixel.depth_weight * bounded * scale;
            let weight = options.weight as f32;
            sums.depth += (0.5 * weight * r * r) as f64;
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

    /// Adds the residuals of the colors of pixels side by side.
    #[inline(always)]
    pub(super) fn add_colors<const DERIVATIVES: bool>(&self, sums: &mut LaneSums, patch: &Patch) {
        let options = self.options;
        let mut used = [0.0f32; LANES];
        used[..patch.count].fill(1.0);
        if options.color_weight > 0.0 {
            let color_weight = options.color_weight as f32;
            let (mut residuals, mut weights) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
            for l in 0..patch.count {
                let observed = self.target.color[patch.at[l]];
                (0..3).for_each(|k| residuals[k][l] = observed[k]);
            }
            for k in 0..3 {
                for l in 0..LANES {
                    residuals[k][l] = patch.color[k][l] - residuals[k][l];
                }
                let mut losses = [0.0; LANES];
                kernel::lanes(options.kernel, &residuals[k], &mut losses, &mut weights[k]);
                for l in 0..LANES {
                    let weight = color_weight * used[l];
                    sums.color[l] += (weight * losses[l]) as f64;
                    weights[k][l] *= weight;
                }
            }
            if DERIVATIVES {
                sums.add(&patch.color_rows, &residuals, &weights);
            }
        }
    }

    /// Adds the residuals of pixels side by side, none of which is hidden.
    #[inline(always)]
    pub(super) fn add_patch<const DERIVATIVES: bool>(&self, sums: &mut LaneSums, patch: &Patch) {
        let options = self.options;
        self.add_colors::<DERIVATIVES>(sums, patch);
        if options.mask_weight > 0.0 {
            let mask_weight = options.mask_weight as f32;
            for l in 0..patch.count {
                let r = 1.0 - self.target.coverage[patch.at[l]];
                sums.mask[l] += (0.5 * mask_weight * r * r) as f64;
            }
        }
        if let Some((options, depth)) = self.depth() {
            let mut measured = [0.0; LANES];
            for l in 0..patch.count {
                measured[l] = depth.pixels()[patch.at[l]];
            }
            let scale = (1.0 / options.scale) as f32;
            let limit = options.truncation as f32;
            let (mut residuals, mut weights) = ([0.0; LANES], [0.0; LANES]);
            let mut rows = [[0.0; LANES]; 6];
            for l in 0..LANES {
                let difference = patch.z[l] - measured[l];
                let bounded = difference.max(-limit).min(limit);
                let r = bounded * scale;
                let weight = if measured[l] > 0.0 { options.weight as f32 } else { 0.0 };
                sums.depth[l] += (0.5 * weight * r * r) as f64;
                let along = if bounded == difference { scale } else { 0.0 };
                for i in 0..6 {
                    rows[i][l] = patch.z_row[i][l] * along;
                }
                residuals[l] = r;
                weights[l] = weight;
            }
            if DERIVATIVES {
                sums.add(&[rows], &[residuals], &[weights]);
            }
        }
    }

    /// Counts pixel `at`, whose residuals come in a patch.
    #[inline]
    pub(super) fn count_covered(&self, sums: &mut Sums, at: usize) {
        sums.counts.covered += 1;
        let compared = self.depth().is_some_and(|(_, depth)| depth.pixels()[at] > 0.0);
        sums.counts.depth += usize::from(compared);
    }

    /// How depth is compared, and with what; a weight of zero leaves it out.
    #[inline]
    fn depth(&self) -> Option<(DepthOptions, &DepthImage)> {
        let options = self.options.depth.filter(|depth| depth.weight > 0.0)?;
        Some((options, self.target.depth.as_ref()?))
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
