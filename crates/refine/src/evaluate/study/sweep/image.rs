//! Images with more noise, and with patches of nothing.

use prehend_geometry::SplitMix64;
use prehend_render::{DepthImage, RgbImage};

use crate::synth::{SensorSettings, smooth_field};

/// Edge of a patch, for an image of 640 columns \[px\].
const PATCH: usize = 8;

/// Standard deviation of noise to add to noise of deviation 1, so that their sum has deviation `factor`.
fn added(factor: f64) -> f64 {
    (factor * factor - 1.0).max(0.0).sqrt()
}

/// Noise of `factor` times what a realistic sensor has, taking it that the image has that already.
pub(super) fn add_depth_noise(image: &mut DepthImage, factor: f64, random: &mut SplitMix64) {
    let (width, height) = (image.width(), image.height());
    let sensor = SensorSettings::realistic().depth;
    let cell = sensor.correlation * width as f64 / 640.0;
    let smooth = smooth_field(width, height, cell, random);
    for (z, smooth) in image.pixels_mut().iter_mut().zip(smooth) {
        let error = sensor.correlated_noise * f64::from(smooth) + sensor.noise * random.normal();
        if *z > 0.0 {
            let growth = (f64::from(*z) / 0.5).powi(2);
            *z = (f64::from(*z) + added(factor) * growth * error).max(1e-3) as f32;
        }
    }
}

/// As [`add_depth_noise`].
pub(super) fn add_color_noise(image: &mut RgbImage, factor: f64, random: &mut SplitMix64) {
    let sensor = SensorSettings::realistic().color;
    for channel in image.pixels_mut().iter_mut().flatten() {
        let error = added(factor) * sensor.noise * random.normal();
        *channel = (f64::from(*channel) + error).clamp(0.0, 1.0) as f32;
    }
}

/// Puts `nothing` in place of the `pixels` of a share of the patches; `width` is that of the image \[px\].
pub(super) fn lose<T: Copy>(
    pixels: &mut [T],
    width: usize,
    nothing: T,
    share: f64,
    random: &mut SplitMix64,
) {
    let edge = (PATCH * width / 640).max(1);
    for patches in pixels.chunks_mut((edge * width).max(1)) {
        for left in (0..width).step_by(edge) {
            if random.uniform() < share {
                let rows = patches.chunks_mut(width);
                rows.for_each(|row| row[left..width.min(left + edge)].fill(nothing));
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
        let SensorSettings { depth, color, .. } = SensorSettings::realistic();
        let deviation = |values: &[f32], mean: f64| {
            let square = |v: &f32| (f64::from(*v) - mean).powi(2);
            (values.iter().map(square).sum::<f64>() / values.len() as f64).sqrt()
        };
        for factor in [2.0, 8.0] {
            let mut image = DepthImage::filled(640, 400, 1.0);
            add_depth_noise(&mut image, factor, &mut random());
            let expected = 4.0 * added(factor) * depth.noise.hypot(depth.correlated_noise);
            let found = deviation(image.pixels(), 1.0);
            assert!((found / expected - 1.0).abs() < 0.05, "{found} {expected}");
            let mut image = RgbImage::filled(100, 100, [0.5; 3]);
            add_color_noise(&mut image, factor, &mut random());
            let found = deviation(image.pixels().as_flattened(), 0.5);
            assert!((found / added(factor) / color.noise - 1.0).abs() < 0.05, "{found}");
        }
        let mut nothing = DepthImage::filled(64, 40, 0.0);
        add_depth_noise(&mut nothing, 8.0, &mut random());
        assert!(nothing.pixels().iter().all(|&z| z == 0.0));
    }

    #[test]
    fn a_share_is_missing_and_more_includes_less() {
        let lost = |share: f64| -> Vec<bool> {
            let mut image = DepthImage::filled(640, 100, 1.0);
            lose(image.pixels_mut(), 640, 0.0, share, &mut SplitMix64::new(4));
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
        lose(image.pixels_mut(), 64, [0.5; 3], 1.0, &mut SplitMix64::new(4));
        assert!(image.pixels().iter().all(|p| *p == [0.5; 3]));
    }
}
