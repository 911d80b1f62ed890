//! Images with more noise, and with patches of nothing.

use prehend_geometry::SplitMix64;
use prehend_render::{DepthImage, RgbImage};

use crate::synth::smooth_field;

/// Standard deviations of a realistic depth camera's noise at half a meter, of single pixels and with a correlation \[m\]; both
/// grow with the square of the depth.
const WHITE: f64 = 3e-4;
const CORRELATED: f64 = 8e-4;
/// Reach of the correlated noise, for an image of 640 columns \[px\].
const CORRELATION: f64 = 3.0;

/// Standard deviation of a realistic camera's noise of each channel.
const COLOR: f64 = 0.01;

/// Edge of a patch, for an image of 640 columns \[px\].
const PATCH: usize = 8;

/// What has to be added to noise of deviation one to make it `factor` times as much.
fn added(factor: f64) -> f64 {
    (factor * factor - 1.0).max(0.0).sqrt()
}

/// Noise of `factor` times what a realistic sensor has, taking it that the image has that already.
pub(super) fn add_depth_noise(image: &mut DepthImage, factor: f64, random: &mut SplitMix64) {
    let (width, height) = (image.width(), image.height());
    let cell = CORRELATION * width as f64 / 640.0;
    let smooth = smooth_field(width, height, cell, random);
    for (z, smooth) in image.pixels_mut().iter_mut().zip(smooth) {
        let error = CORRELATED * f64::from(smooth) + WHITE * random.normal();
        if *z > 0.0 {
            let growth = (f64::from(*z) / 0.5).powi(2);
            *z = (f64::from(*z) + added(factor) * growth * error).max(1e-3) as f32;
        }
    }
}

/// As [`add_depth_noise`].
pub(super) fn add_color_noise(image: &mut RgbImage, factor: f64, random: &mut SplitMix64) {
    for channel in image.pixels_mut().iter_mut().flatten() {
        let error = added(factor) * COLOR * random.normal();
        *channel = (f64::from(*channel) + error).clamp(0.0, 1.0) as f32;
    }
}

/// Depth is missing on a share of the patches.
pub(super) fn lose_depth(image: &mut DepthImage, share: f64, random: &mut SplitMix64) {
    let (width, height) = (image.width(), image.height());
    patches(width, height, share, random, |k| image.pixels_mut()[k] = 0.0);
}

/// A share of the patches is gray.
pub(super) fn lose_color(image: &mut RgbImage, share: f64, random: &mut SplitMix64) {
    let (width, height) = (image.width(), image.height());
    patches(width, height, share, random, |k| image.pixels_mut()[k] = [0.5; 3]);
}

/// Calls `lose` for the pixels of a share of the patches.
fn patches(
    width: usize,
    height: usize,
    share: f64,
    random: &mut SplitMix64,
    mut lose: impl FnMut(usize),
) {
    let edge = (PATCH * width / 640).max(1);
    for top in (0..height).step_by(edge) {
        for left in (0..width).step_by(edge) {
            if random.uniform() >= share {
                continue;
            }
            for y in top..height.min(top + edge) {
                (left..width.min(left + edge)).for_each(|x| lose(y * width + x));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_the_deviation_asked_for() {
        let random = || SplitMix64::new(2);
        let deviation = |values: &[f32], mean: f64| {
            let square = |v: &f32| (f64::from(*v) - mean).powi(2);
            (values.iter().map(square).sum::<f64>() / values.len() as f64).sqrt()
        };
        for factor in [2.0, 8.0] {
            let mut image = DepthImage::filled(640, 400, 1.0);
            add_depth_noise(&mut image, factor, &mut random());
            let expected = 4.0 * added(factor) * WHITE.hypot(CORRELATED);
            let found = deviation(image.pixels(), 1.0);
            assert!((found / expected - 1.0).abs() < 0.05, "{found} {expected}");
            let mut image = RgbImage::filled(100, 100, [0.5; 3]);
            add_color_noise(&mut image, factor, &mut random());
            let found = deviation(image.pixels().as_flattened(), 0.5);
            assert!((found / added(factor) / COLOR - 1.0).abs() < 0.05, "{found}");
        }
        let mut nothing = DepthImage::filled(64, 40, 0.0);
        add_depth_noise(&mut nothing, 8.0, &mut random());
        assert!(nothing.pixels().iter().all(|&z| z == 0.0));
    }

    #[test]
    fn a_share_is_missing_and_more_includes_less() {
        let lost = |share: f64| -> Vec<bool> {
            let mut image = DepthImage::filled(640, 100, 1.0);
            lose_depth(&mut image, share, &mut SplitMix64::new(4));
            image.pixels().iter().map(|&z| z == 0.0).collect()
        };
        let part = |lost: &[bool]| lost.iter().filter(|l| **l).count() as f64 / 64_000.0;
        let (some, more) = (lost(0.25), lost(0.75));
        assert!((part(&some) - 0.25).abs() < 0.04 && (part(&more) - 0.75).abs() < 0.04);
        assert!(some.iter().zip(&more).all(|(some, more)| !some || *more));
        assert_eq!(part(&lost(1.0)), 1.0);
        // Patches, not pixels.
        assert!((0..640).step_by(8).all(|x| (0..8).all(|d| some[x] == some[x + d])));
        let mut image = RgbImage::filled(64, 48, [0.1, 0.2, 0.3]);
        lose_color(&mut image, 1.0, &mut SplitMix64::new(4));
        assert!(image.pixels().iter().all(|p| *p == [0.5; 3]));
    }
}
