//! Settings of the search for corrections.

use crate::defaults::settings;

settings! {
    /// Settings of [`CorrectionTrial`](super::CorrectionTrial) and [`find_corrections`](super::find_corrections).
    ///
    /// Lengths are parts of the object's radius, so that they hold in whatever unit it comes. Values are from sets made by `prehend synth`.
    pub struct CorrectionSettings {
        /// Columns that images have at most: larger ones are made smaller \[px\]. An object of a fifth of that is measured to one percent.
        pub width: usize = 640,
        /// Depth points of the object that a pose is fitted to.
        pub points: usize = 400,
        /// Steps of that fit.
        pub steps: usize = 10,
        /// Standard deviation of the outline against a mask's border \[px\]: masks wobble by that much.
        pub outline: f64 = 1.5,
        /// Standard deviation of depth against the surface, as a part of the object's radius.
        pub depth: f64 = 0.03,
        /// Independent measurements that outline and depth each count as: neighboring pixels are off alike.
        pub measurements: f64 = 60.0,
        /// Weight of what is of the projected object but not of the mask, where no depth tells what hides it.
        pub hidden: f64 = 0.5,
        /// Distance from the outline within which a mask's border is looked for at first, as a part of the object's radius in the image.
        pub reach: f64 = 0.5,
        /// Depth that is farther from the object's counts as of something else, as a part of its radius.
        pub elsewhere: f64 = 0.15,
        /// Standard deviation of poses in each direction, as a part of the distance and of the object's radius: poses to start from are off by centimeters.
        pub shift: [f64; 2] = [0.1, 0.3],
        /// Standard deviation of their rotation \[rad\]: the coarser ones are off by 16° on average.
        pub turn: f64 = 0.5,
        /// Agreement from which on nothing but rotations and sizes is tried: right inputs agree by nine tenths, of little hidden objects.
        pub good: f64 = 0.8,
        /// Agreement from which on what a fit says of sizes is believed: a wrong focal length takes the hand's part of it away.
        pub sized: f64 = 0.7,
        /// Agreement at the pose that mask and depth have from which on the pose to start from is not blamed.
        pub fair: f64 = 0.6,
        /// Agreement that a correction must lead to.
        pub least: f64 = 0.5,
        /// Agreement that a correction must gain on average over many frames, and besides over the square root of their number.
        pub gain: [f64; 2] = [0.03, 0.15],
        /// Agreement that a correction by a value of which nothing is known beforehand must gain: it fits itself to what hides the object.
        pub unnamed_gain: f64 = 0.4,
        /// As `gain`, of colors: right images lose by a half, and tinted light on an object of little color gains 0.2.
        pub color_gain: [f64; 2] = [0.3, 0.3],
        /// Difference of red and blue, over the sum of the channels: that of models which tell nothing, on average, and the one that leaves as much open as it tells.
        pub tint: [f64; 2] = [0.17, 0.35],
        /// Sum of the channels that darkness leaves open.
        pub dark: f64 = 0.15,
        /// Corrections whose agreements differ by less are told apart by what is common: sizes and distances, then their order.
        pub tie: f64 = 0.03,
        /// Extent of objects that are held in hands \[m\].
        pub extent: f64 = 0.15,
        /// Difference in how uncommon the object's size would be, as a logarithm, below which a correction is named beside one that fits as well.
        pub oddness: f64 = 1.0,
        /// The scale of a model, or the focal length, that is told: rigs and scans are off by 2 % and more, and masks by a pixel.
        pub size: f64 = 0.035,
        /// Standard deviations of the mean size beyond which it is told.
        pub sure: f64 = 4.0,
        /// Share of the hand's depth that a corrected focal length must make fit in a frame, that it is the focal length and not the model.
        pub hand_gain: f64 = 0.03,
        /// Largest factor that the size is looked for within.
        pub largest_size: f64 = 1.5,
        /// Frames that are tried, at most: of more, some that are spread over all.
        pub frames: usize = 60,
    }
}
