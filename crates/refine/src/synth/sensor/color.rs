//! A color camera: exposure, white balance, blur and noise.

use prehend_geometry::SplitMix64;
use prehend_render::RgbImage;

use super::settings::ColorSettings;

impl ColorSettings {
    /// Exposure and white balance: what colors are multiplied by.
    pub(super) fn gains(&self, noise: &mut SplitMix64) -> [f32; 3] {
        let exposure = (self.exposure * noise.normal()).exp2();
        let gain = |_| (exposure * (1.0 + self.white_balance * noise.normal()).max(0.1)) as f32;
        [0; 3].map(gain)
    }

    /// The picture that the camera takes.
    pub(super) fn expose(
        &self,
        truth: &RgbImage,
        gain: [f32; 3],
        noise: &mut SplitMix64,
    ) -> RgbImage {
        let mut picture = blurred(truth, self.blur * (0.4 + 0.6 * noise.uniform()));
        let (dark, shot) = ((self.noise * self.noise) as f32, self.shot_noise as f32);
        let noisy = dark > 0.0 || shot > 0.0;
        for pixel in picture.pixels_mut() {
            for (level, gain) in pixel.iter_mut().zip(gain) {
                let exposed = (gain * *level).min(1.0);
                // The variance grows with brightness.
                let spread = (dark + shot * exposed).sqrt();
                let error = if noisy { spread * noise.normal() as f32 } else { 0.0 };
                *level = (exposed + error).clamp(0.0, 1.0);
            }
        }
        picture
    }
}

/// Blurred by a normal distribution of that standard deviation \[px\]; borders repeat.
fn blurred(image: &RgbImage, sigma: f64) -> RgbImage {
    if sigma < 0.05 {
        return image.clone();
    }
    let reach = (3.0 * sigma).ceil() as usize;
    let bell = |d: usize| (-0.5 * (d as f64 / sigma).powi(2)).exp();
    let total = bell(0) + 2.0 * (1..=reach).map(bell).sum::<f64>();
    let weights: Vec<f32> = (0..=reach).map(|d| (bell(d) / total) as f32).collect();
    let (width, height) = (image.width(), image.height());
    // First across, then down: places along a line of that many pixels, `stride` apart.
    [(1, width), (width, height)].into_iter().fold(image.clone(), |image, (stride, length)| {
        let mut soft = RgbImage::filled(width, height, [0.0; 3]);
        for (i, value) in soft.pixels_mut().iter_mut().enumerate() {
            let at = i / stride % length;
            let pixel = |place: usize| image.pixels()[i - at * stride + place * stride];
            *value = pixel(at).map(|v| v * weights[0]);
            for (d, weight) in weights.iter().enumerate().skip(1) {
                let (ahead, back) = (pixel((at + d).min(length - 1)), pixel(at.saturating_sub(d)));
                (0..3).for_each(|c| value[c] += weight * (ahead[c] + back[c]));
            }
        }
        soft
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::sensor::settings::SensorSettings;

    #[test]
    fn blur_keeps_the_mean_and_spreads_a_point() {
        let mut image = RgbImage::filled(31, 21, [0.0; 3]);
        image.pixels_mut()[10 * 31 + 15] = [1.0, 0.5, 0.0];
        let soft = blurred(&image, 1.2);
        let sum: f32 = soft.pixels().iter().map(|p| p[0]).sum();
        assert!((sum - 1.0).abs() < 1e-5);
        let moment: f32 = soft
            .pixels()
            .iter()
            .enumerate()
            .map(|(i, p)| p[0] * ((i % 31) as f32 - 15.0).powi(2))
            .sum();
        assert!((moment - 1.44).abs() < 0.1, "{moment}");
        let flat = RgbImage::filled(9, 9, [0.3, 0.6, 0.9]);
        let still = blurred(&flat, 2.0);
        assert!(still.pixels().iter().all(|p| (p[1] - 0.6).abs() < 1e-6));
    }

    #[test]
    fn noise_and_gains_are_as_strong_as_asked_for() {
        let flat = RgbImage::filled(100, 100, [0.4; 3]);
        let mut noise = SplitMix64::new(6);
        let expose = |settings: &ColorSettings, noise: &mut SplitMix64| {
            let gains = settings.gains(noise);
            settings.expose(&flat, gains, noise)
        };
        let clean = expose(&SensorSettings::clean().color, &mut noise);
        let spread = |image: &RgbImage| {
            let mean = image.pixels().iter().map(|p| p[0]).sum::<f32>() / 1e4;
            let square = image.pixels().iter().map(|p| (p[0] - mean).powi(2)).sum::<f32>() / 1e4;
            (mean, square.sqrt())
        };
        let (mean, sigma) = spread(&clean);
        assert!((mean - 0.4).abs() < 1e-3 && (sigma - 0.01).abs() < 5e-4, "{mean} {sigma}");
        let settings = SensorSettings::realistic().color;
        let means: Vec<f32> = (0..40).map(|_| spread(&expose(&settings, &mut noise)).0).collect();
        let stops: f32 = means.iter().map(|m| (m / 0.4).log2().powi(2)).sum::<f32>() / 40.0;
        assert!((0.2..0.5).contains(&stops.sqrt()), "{}", stops.sqrt());
    }
}
