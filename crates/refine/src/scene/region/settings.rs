//! Settings of the evidence of regions.

use crate::defaults::settings;

settings! {
    /// How far masks and colors tell the object from its surroundings, pixel by pixel: limits on log-likelihood ratios, and errors of a mask's border.
    #[derive(Copy)]
    pub struct ForegroundSettings {
        /// Largest log-likelihood ratio of the mask \[nat\]: odds of twenty to one away from its border.
        pub mask_limit: f64 = 3.0,
        /// Largest log-likelihood ratio of a color beside the mask \[nat\]: below the mask's, since the object and what is around it may share colors.
        /// EXPERIMENTS: Weight of color, 2 instead of 1 nat.
        pub color_limit: f64 = 1.0,
        /// Smallest contrast of a border, as a share of the mean contrast: some borders are seen of which nothing is.
        pub least_contrast: f64 = 0.2,
        /// Probability of a color that was never seen (additive smoothing).
        pub unseen: f64 = 1e-4,
        /// Standard deviation of the border of a mask that is drawn with care \[px\].
        pub border_sigma: f64 = 1.5,
        /// Half-width of the Cauchy distribution of what a mask is grown or shrunk by everywhere \[px\].
        pub growth: f64 = 0.5,
        /// Effective sample size of all pixels about a border as measurements of that growth: shadows and shades err alike along it. EXPERIMENTS: Offset of
        /// the outline.
        pub effective_samples: f64 = 5.0,
    }
}
