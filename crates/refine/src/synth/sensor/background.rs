//! The room behind the hand.

use prehend_geometry::SplitMix64;
use prehend_render::{Camera, DepthImage, RgbImage};

use super::settings::BackgroundSettings;
use super::smooth_field::smooth_field;

impl BackgroundSettings {
    /// Color and depth of a random room without the hand.
    pub(super) fn draw(&self, camera: &Camera, noise: &mut SplitMix64) -> (RgbImage, DepthImage) {
        let (width, height) = (camera.width, camera.height);
        let mut color = RgbImage::filled(width, height, muted(noise));
        let mut depth = DepthImage::filled(width, height, 0.0);
        let distance = self.distance * (0.75 + 0.5 * noise.uniform());
        let [right, down] = [0; 2].map(|_| self.slope * noise.normal());
        for (i, z) in depth.pixels_mut().iter_mut().enumerate() {
            let ray = camera.ray((i % width) as f64, (i / width) as f64);
            // The plane z = distance + right·x + down·y; where it opens away from the camera, far off.
            let opening = (1.0 - right * ray.x - down * ray.y).max(0.25);
            *z = (distance / opening) as f32;
        }
        let things = (f64::from(self.things) * (0.5 + 0.5 * noise.uniform())) as u32;
        // From the back to the front.
        let mut order: Vec<f64> = (0..things).map(|_| noise.uniform()).collect();
        order.sort_by(f64::total_cmp);
        for before in order {
            let thing = Thing::random(camera, (distance * (0.95 - 0.3 * before)) as f32, noise);
            thing.draw(&mut color, &mut depth);
        }
        if self.pattern > 0.0 {
            self.paint(&mut color, noise);
        }
        (color, depth)
    }

    fn paint(&self, color: &mut RgbImage, noise: &mut SplitMix64) {
        let (width, height) = (color.width(), color.height());
        for (cell, share) in [(0.2, 0.8), (0.02, 0.5)] {
            let field = smooth_field(width, height, cell * width as f64, noise);
            let weight = [0; 3].map(|_| (share * self.pattern * (0.7 + noise.uniform())) as f32);
            for (pixel, value) in color.pixels_mut().iter_mut().zip(field) {
                (0..3).for_each(|c| pixel[c] = (pixel[c] + weight[c] * value).clamp(0.0, 1.0));
            }
        }
    }
}

/// A dull color.
fn muted(noise: &mut SplitMix64) -> [f32; 3] {
    let gray = 0.1 + 0.6 * noise.uniform();
    [0; 3].map(|_| (gray + 0.05 * noise.normal()).clamp(0.02, 0.95) as f32)
}

/// A rounded box that stands somewhere.
struct Thing {
    center: [f32; 2],
    half: [f32; 2],
    turn: [f32; 2],
    /// Exponent of the outline: 2 an ellipse, more a box.
    power: i32,
    color: [f32; 3],
    depth: f32,
}

impl Thing {
    fn random(camera: &Camera, depth: f32, noise: &mut SplitMix64) -> Self {
        let (width, height) = (camera.width as f64, camera.height as f64);
        let center = [width * noise.uniform(), height * noise.uniform()].map(|v| v as f32);
        let half = [0; 2].map(|_| (width * (0.03 + 0.12 * noise.uniform())) as f32);
        let angle = (std::f64::consts::PI * noise.uniform()) as f32;
        let power = if noise.uniform() < 0.3 { 2 } else { 8 };
        let color = muted(noise).map(|c| (c + 0.07 * noise.normal() as f32).clamp(0.0, 1.0));
        Self { center, half, turn: [angle.cos(), angle.sin()], power, color, depth }
    }

    fn draw(&self, color: &mut RgbImage, depth: &mut DepthImage) {
        let (width, height) = (color.width(), color.height());
        let reach = 1.5 * self.half[0].max(self.half[1]);
        let span = |middle: f32, size: usize| {
            (middle - reach).max(0.0) as usize..((middle + reach).max(0.0) as usize).min(size)
        };
        for y in span(self.center[1], height) {
            for x in span(self.center[0], width) {
                let (dx, dy) = (x as f32 - self.center[0], y as f32 - self.center[1]);
                let a = (self.turn[0] * dx + self.turn[1] * dy) / self.half[0];
                let b = (self.turn[0] * dy - self.turn[1] * dx) / self.half[1];
                let outside = a.powi(self.power) + b.powi(self.power) - 1.0;
                if outside < 0.0 {
                    color.pixels_mut()[y * width + x] = self.color;
                    depth.pixels_mut()[y * width + x] = self.depth;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::sensor::settings::SensorSettings;

    #[test]
    fn every_pixel_has_a_color_and_lies_behind_the_hand() {
        let camera = SensorSettings::clean().viewpoint.camera(320, 240);
        let mut noise = SplitMix64::new(8);
        for settings in [SensorSettings::clean().background, SensorSettings::realistic().background]
        {
            let (color, depth) = settings.draw(&camera, &mut noise);
            assert!(depth.pixels().iter().all(|z| (0.5..6.5).contains(z)));
            assert!(color.pixels().iter().flatten().all(|c| (0.0..=1.0).contains(c)));
            let first = color.pixels()[0];
            let varied = color.pixels().iter().any(|p| *p != first);
            assert_eq!(varied, settings.things > 0);
        }
    }
}
