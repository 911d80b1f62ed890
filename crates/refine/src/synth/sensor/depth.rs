//! A stereo depth camera and its faults.

use prehend_geometry::SplitMix64;
use prehend_render::{Camera, DepthImage};

use super::settings::DepthSettings;
use super::smooth_field::smooth_field;

impl DepthSettings {
    /// Errors that stay the same through a grasp.
    pub(super) fn bias(&self, camera: &Camera, noise: &mut SplitMix64) -> DepthBias {
        let scale = (1.0 + self.scale * noise.normal()) as f32;
        let (size, cell) = ((camera.width, camera.height), camera.width as f64 / 3.0);
        let mut warp = field(self.warp, size, cell, noise);
        warp.iter_mut().for_each(|v| *v *= self.warp as f32);
        DepthBias { scale, warp }
    }

    /// Depth image that the camera measures where the depths are `truth`.
    pub(super) fn measure(
        &self,
        truth: &DepthImage,
        camera: &Camera,
        bias: &DepthBias,
        noise: &mut SplitMix64,
    ) -> DepthImage {
        let mut depth = self.spread(truth, noise);
        let lost = self.lost(truth, camera, noise);
        self.fly(truth, &mut depth, noise);
        let size = (depth.width(), depth.height());
        let correlated = field(self.correlated_noise, size, self.correlation, noise);
        // Noise grows with the squared depth.
        let near = |fault: f64, z: f32| fault as f32 * (z / 0.5) * (z / 0.5);
        let steps = self.disparity_step > 0.0 && self.baseline > 0.0;
        let disparity = (camera.fx * self.baseline) as f32;
        let step = self.disparity_step as f32;
        for (i, z) in depth.pixels_mut().iter_mut().enumerate() {
            let seen = *z;
            if seen > 0.0 {
                *z = seen * bias.scale + bias.warp[i];
                *z += near(self.correlated_noise, seen) * correlated[i];
                if self.noise > 0.0 {
                    *z += near(self.noise, seen) * noise.normal() as f32;
                }
            }
            if steps && *z > 0.0 {
                *z = disparity / (step * (disparity / *z / step).round().max(1.0));
            }
            *z = if lost[i] { 0.0 } else { z.max(0.0) };
        }
        depth
    }

    /// Grows what is near over what is behind, more in some places than in others.
    fn spread(&self, truth: &DepthImage, noise: &mut SplitMix64) -> DepthImage {
        let (width, height) = (truth.width(), truth.height());
        let mut depth = truth.clone();
        if self.fattening <= 0.0 {
            return depth;
        }
        let field = smooth_field(width, height, 10.0, noise);
        for pass in 0..self.fattening.ceil() as usize {
            let before = depth.clone();
            let reaches = |i: usize| {
                let share = (0.5 + 0.3 * f64::from(field[i])).clamp(0.0, 1.0);
                self.fattening * share > pass as f64 + 0.5
            };
            for i in (0..width * height).filter(|i| reaches(*i)) {
                let least = nearest_around(&before, i % width, i / width);
                if depth.pixels()[i] - least > EDGE {
                    depth.pixels_mut()[i] = least;
                }
            }
        }
        depth
    }

    /// Puts pixels beside edges between the two sides.
    fn fly(&self, truth: &DepthImage, depth: &mut DepthImage, noise: &mut SplitMix64) {
        if self.flying_share <= 0.0 {
            return;
        }
        let width = truth.width();
        let before = depth.clone();
        for (i, z) in depth.pixels_mut().iter_mut().enumerate() {
            let least = nearest_around(&before, i % width, i / width);
            if *z - least > EDGE && noise.uniform() < self.flying_share {
                *z = least + (*z - least) * noise.uniform() as f32;
            }
        }
    }

    /// The pixels without a depth.
    fn lost(&self, truth: &DepthImage, camera: &Camera, noise: &mut SplitMix64) -> Vec<bool> {
        let (width, height) = (truth.width(), truth.height());
        let mut lost = vec![false; width * height];
        if self.hole_share > 0.0 {
            let field = smooth_field(width, height, 5.0, noise);
            let limit = upper_quantile(self.hole_share);
            lost.iter_mut().zip(field).for_each(|(l, v)| *l |= v > limit);
        }
        if self.grazing_deg > 0.0 {
            for (i, l) in lost.iter_mut().enumerate() {
                let Some(sine) = sine_to_surface(truth, camera, i % width, i / width) else {
                    continue;
                };
                let angle = sine.asin().to_degrees();
                // From none at twice the angle to all at zero.
                let share = 1.0 - 0.5 * angle / self.grazing_deg;
                *l |= share > 0.0 && noise.uniform() < share;
            }
        }
        if self.baseline > 0.0 {
            let disparity = (camera.fx * self.baseline) as f32;
            for (row, lost) in truth.pixels().chunks(width).zip(lost.chunks_mut(width)) {
                // In the right eye's row, what comes from the right of a pixel must stay to the right of it.
                let mut least = f32::INFINITY;
                for (x, z) in row.iter().enumerate().rev().filter(|(_, z)| **z > 0.0) {
                    let at = x as f32 - disparity / z;
                    lost[x] |= at > least + 0.5;
                    least = least.min(at);
                }
            }
        }
        lost
    }
}

/// A [`smooth_field`]; zeros, and no number drawn, for a fault of strength zero.
fn field(strength: f64, size: (usize, usize), cell: f64, noise: &mut SplitMix64) -> Vec<f32> {
    match strength > 0.0 {
        true => smooth_field(size.0, size.1, cell, noise),
        false => vec![0.0; size.0 * size.1],
    }
}

/// Errors that stay the same through a grasp.
pub(super) struct DepthBias {
    pub(super) scale: f32,
    /// Added to each pixel \[m\].
    pub(super) warp: Vec<f32>,
}

/// Neighbors that differ by more lie on different surfaces \[m\].
const EDGE: f32 = 0.01;

/// The least depth of the pixel and its eight neighbors.
fn nearest_around(depth: &DepthImage, x: usize, y: usize) -> f32 {
    let (width, height) = (depth.width(), depth.height());
    let mut least = f32::INFINITY;
    for row in y.saturating_sub(1)..(y + 2).min(height) {
        let start = row * width;
        for z in &depth.pixels()[start + x.saturating_sub(1)..start + (x + 2).min(width)] {
            if *z > 0.0 && *z < least {
                least = *z;
            }
        }
    }
    least
}

/// Sine of the angle between the line of sight and the surface; none at edges and borders.
fn sine_to_surface(depth: &DepthImage, camera: &Camera, x: usize, y: usize) -> Option<f64> {
    let z = depth.get(x, y).filter(|z| *z > 0.0)?;
    let beside = |x: usize, y: usize| {
        let other = depth.get(x, y).filter(|o| *o > 0.0 && (*o - z).abs() < EDGE)?;
        Some(camera.unproject(x as f64, y as f64, f64::from(other)))
    };
    let here = camera.unproject(x as f64, y as f64, f64::from(z));
    let normal = (beside(x + 1, y)? - here).cross(&(beside(x, y + 1)? - here));
    let normal = normal.try_normalize(1e-18)?;
    Some(normal.dot(&here.coords.normalize()).abs().min(1.0))
}

/// Upper quantile of the standard normal distribution at probability `share` (Abramowitz and Stegun, 26.2.23, off by 4.5e-4 at
/// most).
fn upper_quantile(share: f64) -> f32 {
    let share = share.clamp(1e-9, 1.0 - 1e-9);
    let t = (-2.0 * share.min(1.0 - share).ln()).sqrt();
    let above = 2.515517 + t * (0.802853 + t * 0.010328);
    let below = 1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308));
    let quantile = t - above / below;
    (if share > 0.5 { -quantile } else { quantile }) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::sensor::settings::SensorSettings;

    const SIZE: (usize, usize) = (320, 240);

    /// A square at half a meter before a wall at one meter.
    fn step() -> (Camera, DepthImage) {
        let camera = SensorSettings::clean().viewpoint.camera(SIZE.0, SIZE.1);
        let mut depth = DepthImage::filled(SIZE.0, SIZE.1, 1.0);
        for y in 60..180 {
            depth.pixels_mut()[y * SIZE.0 + 100..y * SIZE.0 + 220].fill(0.5);
        }
        (camera, depth)
    }

    fn measured(settings: &DepthSettings) -> DepthImage {
        let (camera, depth) = step();
        let mut noise = SplitMix64::new(11);
        let bias = settings.bias(&camera, &mut noise);
        settings.measure(&depth, &camera, &bias, &mut noise)
    }

    fn without() -> DepthSettings {
        DepthSettings { noise: 0.0, ..SensorSettings::clean().depth }
    }

    #[test]
    fn without_faults_the_truth_is_measured() {
        assert_eq!(measured(&without()), step().1);
    }

    #[test]
    fn clean_noise_has_its_strength_and_no_holes() {
        let seen = measured(&SensorSettings::clean().depth);
        let (mut sum, mut count) = (0.0, 0.0);
        for (z, t) in seen.pixels().iter().zip(step().1.pixels()).filter(|(_, t)| **t == 0.5) {
            sum += (z - t).powi(2);
            count += 1.0;
        }
        assert!(((sum / count).sqrt() - 7e-4).abs() < 3e-5);
        assert!(seen.pixels().iter().all(|z| *z > 0.0));
    }

    #[test]
    fn near_things_grow_and_edges_fly() {
        let fat = measured(&DepthSettings { fattening: 3.0, ..without() });
        let near = fat.pixels().iter().filter(|z| **z == 0.5).count();
        let true_near = 120 * 120;
        assert!(near > true_near + 300 && near < true_near + 1600, "{near}");
        let flying = measured(&DepthSettings { flying_share: 0.5, ..without() });
        let between = flying.pixels().iter().filter(|z| **z > 0.51 && **z < 0.99).count();
        assert!((150..330).contains(&between), "{between}");
    }

    #[test]
    fn what_one_eye_alone_sees_and_grazing_surfaces_are_lost() {
        let stereo = measured(&DepthSettings { baseline: 0.05, ..without() });
        let holes = stereo.pixels().iter().filter(|z| **z == 0.0).count() as f64 / 120.0;
        // f b (1/0.5 − 1/1) of each of 120 rows, up to whole pixels at both ends.
        let band = 0.906 * 320.0 * 0.05 * (2.0 - 1.0);
        assert!((holes - band).abs() < 2.0, "{holes} {band}");
        let camera = step().0;
        let mut slope = DepthImage::filled(SIZE.0, SIZE.1, 0.6);
        let seen = DepthSettings { grazing_deg: 10.0, ..without() };
        let mut noise = SplitMix64::new(2);
        let bias = seen.bias(&camera, &mut noise);
        let facing = seen.measure(&slope, &camera, &bias, &mut noise);
        assert_eq!(facing, slope, "a wall that faces the camera has no grazing pixel");
        // Some twelve degrees where it is near.
        let steep = |i: usize| 0.4 + 8e-3 * (i % SIZE.0) as f32;
        slope.pixels_mut().iter_mut().enumerate().for_each(|(i, z)| *z = steep(i));
        let grazed = seen.measure(&slope, &camera, &bias, &mut noise);
        let lost = grazed.pixels().iter().filter(|z| **z == 0.0).count();
        assert!(lost > SIZE.0 * SIZE.1 / 40, "{lost}");
    }

    #[test]
    fn holes_take_their_share_and_disparity_has_steps() {
        let holes = measured(&DepthSettings { hole_share: 0.05, ..without() });
        let share = holes.pixels().iter().filter(|z| **z == 0.0).count() as f64 / 76800.0;
        assert!((0.025..0.1).contains(&share), "{share}");
        let settings =
            DepthSettings { baseline: 0.05, disparity_step: 0.5, ..SensorSettings::clean().depth };
        let seen = measured(&settings);
        let disparity = 0.906 * 320.0 * 0.05;
        for z in seen.pixels().iter().filter(|z| **z > 0.0) {
            let steps = disparity / f64::from(*z) / 0.5;
            assert!((steps - steps.round()).abs() < 1e-3, "{z}");
        }
        assert!((upper_quantile(0.025) - 1.96).abs() < 1e-3 && upper_quantile(0.5).abs() < 1e-3);
    }

    #[test]
    fn scale_and_warp_are_as_strong_as_asked_for() {
        let (camera, _) = step();
        let mut noise = SplitMix64::new(4);
        let settings = SensorSettings::realistic().depth;
        let (mut scale, mut warp) = (0.0, 0.0);
        for _ in 0..100 {
            let bias = settings.bias(&camera, &mut noise);
            scale += (f64::from(bias.scale) - 1.0).powi(2) / 100.0;
            warp += f64::from(bias.warp[1234]).powi(2) / 100.0;
        }
        assert!((scale.sqrt() / settings.scale - 1.0).abs() < 0.25);
        assert!((warp.sqrt() / settings.warp - 1.0).abs() < 0.25);
    }
}
