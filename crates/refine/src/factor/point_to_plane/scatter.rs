//! How depth points scatter about a surface.

use crate::problem::State;

use super::{PlaneResidual, PointToPlaneFactor};

/// How depth points scatter about a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NoiseEstimate {
    /// Standard deviation of a point \[m\].
    pub sigma: f64,
    /// The part of it that neighboring points have in common \[m\].
    pub correlated: f64,
    /// The part that is independent from point to point \[m\].
    pub independent: f64,
    /// How many independent measurements the points amount to.
    pub effective_samples: f64,
}

/// Number, sum and sum of squares of the residuals in a patch.
#[derive(Clone, Copy, Default)]
struct ScatterPatch {
    count: f64,
    sum: f64,
    squares: f64,
}

impl PointToPlaneFactor {
    /// How the points scatter about the surface at `state`, which should be the best there is; `None` if there are too few.
    ///
    /// Where errors are alike within patches, their means scatter more than means of independent errors would: so many patches as
    /// there are, and as many measurements a patch as the variance of the means is smaller than that of the points.
    pub(crate) fn noise_estimate(&self, state: &State) -> Option<NoiseEstimate> {
        let pixels = || self.points.iter().map(|point| point.pixel);
        let (left, right) = (pixels().map(|p| p.0).min()?, pixels().map(|p| p.0).max()?);
        let (top, bottom) = (pixels().map(|p| p.1).min()?, pixels().map(|p| p.1).max()?);
        let area = ((right - left + 1) * (bottom - top + 1)) as f64;
        let wanted = self.settings.noise_patches;
        let side = (area / wanted).sqrt().max(1.0);
        let patch = |from: usize, to: usize| ((to - from) as f64 / side) as usize;
        let across = patch(left, right) + 1;
        let mut patches = vec![ScatterPatch::default(); across * (patch(top, bottom) + 1)];
        let limit = self.settings.noise.kernel.scale().unwrap_or(f64::INFINITY);
        for (point, residual) in self.points.iter().zip(self.residuals(state)) {
            let Some(PlaneResidual { distance, facing, .. }) = residual else { continue };
            let residual = distance.clamp(-limit, limit);
            let (x, y) = point.pixel;
            let patch = &mut patches[patch(top, y) * across + patch(left, x)];
            patch.count += facing;
            patch.sum += facing * residual;
            patch.squares += facing * residual * residual;
        }
        patches.retain(|patch| patch.count >= self.settings.least_points);
        let total = patches.iter().map(|patch| patch.count).sum::<f64>();
        let of_means = patches.iter().map(|p| p.sum * p.sum / p.count).sum::<f64>() / total;
        let of_points = patches.iter().map(|patch| patch.squares).sum::<f64>() / total;
        // A row of patches at least.
        if !(of_means > 0.0 && patches.len() as f64 >= wanted.sqrt()) {
            return None;
        }
        let (number, count) = (patches.len() as f64, self.points.len() as f64);
        let own = ((of_points - of_means) * total / (total - number)).max(0.0);
        Some(NoiseEstimate {
            sigma: of_points.sqrt(),
            // Means of a few points scatter even if these have nothing in common.
            correlated: (of_means - own * number / total).max(0.0).sqrt(),
            independent: own.sqrt(),
            effective_samples: (number * of_points / of_means).min(count),
        })
    }
}

#[cfg(test)]
mod tests {
    use prehend_geometry::SplitMix64;

    use super::super::super::gradient_check::{fixture, scene};
    use super::super::{PointToPlaneFactor, PointToPlaneSettings};
    use super::*;
    use crate::problem::NoiseModel;
    use crate::scene::PreparedFrame;

    /// Noise estimate from the built-in scene's depth with normal errors \[m\]: `independent` of each point, `shared` in tiles of `tile` pixels.
    fn estimate(independent: f64, [shared, tile]: [f64; 2]) -> NoiseEstimate {
        let scene = scene();
        let (_, state) = fixture(0);
        let mut observation = scene.frame.clone();
        let mut random = SplitMix64::new(3);
        let width = observation.depth.width();
        let place = |pixel: usize| [pixel % width, pixel / width].map(|x| x / tile as usize);
        let tiles: Vec<f64> = (0..10_000).map(|_| shared * random.normal()).collect();
        for (pixel, depth) in observation.depth.pixels_mut().iter_mut().enumerate() {
            let [x, y] = place(pixel);
            *depth += (independent * random.normal() + tiles[100 * y + x]) as f32;
        }
        let frame = PreparedFrame::new(&observation, &scene.object).unwrap();
        // A kernel would limit the errors.
        let noise = NoiseModel::gaussian(2e-3);
        let settings = PointToPlaneSettings { noise, gp_sigma: 0.0, ..Default::default() };
        let factor = PointToPlaneFactor::new(&frame, &settings).unwrap();
        let truth = State { t_cam_object: scene.truth, ..state };
        factor.noise_estimate(&truth).unwrap()
    }

    #[test]
    fn what_neighbors_have_in_common_is_told_from_the_rest() {
        let alone = estimate(2e-3, [0.0, 16.0]);
        let both = estimate(2e-3, [2e-3, 16.0]);
        for NoiseEstimate { sigma, correlated, independent, .. } in [alone, both] {
            assert!((sigma / correlated.hypot(independent) - 1.0).abs() < 1e-9);
            assert!((independent / 2e-3 - 1.0).abs() < 0.4, "{independent}");
        }
        assert!(alone.correlated < 0.3 * alone.independent, "{alone:?}");
        assert!((both.correlated / 2e-3 - 0.8).abs() < 0.5, "{both:?}");
        assert!(both.effective_samples < 0.5 * alone.effective_samples, "{alone:?} {both:?}");
    }
}
