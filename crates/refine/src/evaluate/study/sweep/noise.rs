//! More noise in the images.

use prehend_geometry::SplitMix64;
use prehend_render::{DepthImage, RgbImage};

use crate::data::smooth_field;

/// Standard deviations of a realistic depth camera's noise at half a meter, of single pixels and with a correlation \[m\]; both
/// grow with the square of the depth.
const WHITE: f64 = 3e-4;
const CORRELATED: f64 = 8e-4;
/// Reach of the correlated noise, for an image of 640 columns \[px\].
const CORRELATION: f64 = 3.0;

/// Standard deviation of a realistic camera's noise of each channel.
const COLOR: f64 = 0.01;

/// What has to be added to noise of deviation one to make it `factor` times as much.
fn added(factor: f64) -> f64 {
    (factor * factor - 1.0).max(0.0).sqrt()
}

/// Noise of `factor` times what a realistic sensor has, taking it that the image has that already.
pub(super) fn depth(image: &mut DepthImage, factor: f64, random: &mut SplitMix64) {
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

/// As [`depth`].
pub(super) fn color(image: &mut RgbImage, factor: f64, random: &mut SplitMix64) {
    for channel in image.pixels_mut().iter_mut().flatten() {
        let error = added(factor) * COLOR * random.normal();
        *channel = (f64::from(*channel) + error).clamp(0.0, 1.0) as f32;
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
            depth(&mut image, factor, &mut random());
            let expected = 4.0 * added(factor) * WHITE.hypot(CORRELATED);
            let found = deviation(image.pixels(), 1.0);
            assert!((found / expected - 1.0).abs() < 0.05, "{found} {expected}");
            let mut image = RgbImage::filled(100, 100, [0.5; 3]);
            color(&mut image, factor, &mut random());
            let found = deviation(image.pixels().as_flattened(), 0.5);
            assert!((found / added(factor) / COLOR - 1.0).abs() < 0.05, "{found}");
        }
        let mut nothing = DepthImage::filled(64, 40, 0.0);
        depth(&mut nothing, 8.0, &mut random());
        assert!(nothing.pixels().iter().all(|&z| z == 0.0));
    }
}
