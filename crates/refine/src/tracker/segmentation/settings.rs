//! Settings of segmentation.

use crate::defaults::settings;

settings! {
    /// Segmentation of the object in a picture by its predicted pose, depth, colors and masks.
    #[derive(Copy)]
    pub struct SegmentationSettings {
        /// Distance of the rows and columns of which colors, depth and masks are asked \[px\]: that of the window below.
        pub stride: usize = 2,
        /// Distance from where it should be within which the object is looked for \[m\].
        pub reach: f64 = 0.04,
        /// Half-width of the band about the outline in which that is expected \[px of the window\]; depth of the surface is carried on over four times as
        /// many.
        pub band: usize = 4,
        /// Probability that the object is where it should be.
        pub prior: f64 = 0.85,
        /// Largest log-likelihood ratio of a color \[nat\]; from half of it on it is another thing's, whatever depth says: what is found may lie flush with a wall.
        pub color_limit: f64 = 2.0,
        /// Standard deviation of depth about where the object should be, and at the hand \[m\]; what is three of them away is not of the object.
        pub depth_sigma: f64 = 5e-3,
        /// Density of depths of what is not known \[1/m\].
        pub background: f64 = 3.0,
        /// Share of outliers of depth, not in front of the object, where that is seen.
        pub outliers: f64 = 0.03,
        /// Distance from the middle of a hand within which it holds something \[m\].
        pub held: f64 = 0.2,
        /// Number of pixels that are needed to judge by.
        pub enough: usize = 30,
        /// Share that is too small to judge by: of the pixels that should show the object, of the area that was seen of it before, of its largest part.
        pub least_share: f64 = 0.1,
        /// Probability that a mask errs, at least.
        pub mask_error: f64 = 0.02,
        /// Without depth: overlap of a given mask and the pixels that seem to show the object, as a share of the larger, from which the mask counts.
        pub agreement: f64 = 0.5,
        /// Without depth: standard deviation of the outline of a stated pose \[m\]. EXPERIMENTS: No mask, color only.
        pub stated_sigma: f64 = 5e-3,
        /// Without depth: standard deviation of the sides of a box that is given for a mask \[px\].
        pub box_sigma: f64 = 5.0,
        /// Without depth: number of places that are compared where an object is looked for.
        pub places: usize = 4,
        /// Without depth or mask: number of times that colors and pose are found in turns.
        pub rounds: usize = 3,
    }
}

impl SegmentationSettings {
    pub(in crate::tracker) fn stride(&self) -> usize {
        self.stride.max(1)
    }

    /// Distance from which depth is not of the object \[m\].
    pub(super) fn off_object(&self) -> f32 {
        (3.0 * self.depth_sigma) as f32
    }
}
