//! How pixels are drawn, or parts of pixels.

use glam::Vec2;
use nalgebra::{RealField, convert};

use crate::mode::ContourOptions;

/// How coverage falls across a contour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum DrawStep {
    /// Smoothly, from 1 at −w to 0 at +w \[px\].
    Smooth(f32),
    /// As the part of a square pixel that lies on this side of a straight contour.
    Square,
}

impl DrawStep {
    /// Coverage is one or zero farther away than this \[px\].
    pub(crate) fn reach(self) -> f32 {
        match self {
            Self::Smooth(half_width) => half_width,
            Self::Square => std::f32::consts::FRAC_1_SQRT_2,
        }
    }

    /// Coverage at signed distance `s` \[px\], positive outside, from a contour with unit normal `normal`, and its slope.
    #[inline]
    pub(crate) fn at(self, s: f32, normal: Vec2) -> (f32, f32) {
        match self {
            Self::Smooth(half_width) => falling_step(s, half_width),
            Self::Square => square_step(s, normal),
        }
    }
}

/// The smooth step from 1 at −w to 0 at +w, and its derivative.
#[inline]
pub(crate) fn falling_step<T: RealField + Copy>(s: T, w: T) -> (T, T) {
    let (one, two, three): (T, T, T) = (T::one(), convert(2.0), convert(3.0));
    let x = ((w - s) / (two * w)).clamp(T::zero(), one);
    (x * x * (three - two * x), -three * x * (one - x) / w)
}

/// The part of the unit square about the origin in which `normal`·p < −`s`, and its derivative by `s`: the length of the cut.
fn square_step(s: f32, normal: Vec2) -> (f32, f32) {
    let Vec2 { x: p, y: q } = normal.abs();
    let (long, short) = if p > q { (p, q) } else { (q, p) };
    // The square's extent along the normal is a trapezoid: flat to `inner`, zero from `outer` on.
    let (inner, outer) = (0.5 * (long - short), 0.5 * (long + short));
    let height = 1.0 / long.max(0.5);
    let distance = s.abs();
    let (tail, slope) = if distance >= outer {
        (0.0, 0.0)
    } else if distance > inner {
        let left = outer - distance;
        let steep = height / (outer - inner);
        (0.5 * steep * left * left, steep * left)
    } else {
        (0.5 - height * distance, height)
    };
    (if s < 0.0 { 1.0 - tail } else { tail }, -slope)
}

/// How the contour mode draws the pixels of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Drawing {
    pub(crate) step: DrawStep,
    /// Whether creases are blended.
    pub(crate) creases: bool,
    /// Slopes of the image are those between the sides of a pixel; otherwise those at its center.
    pub(crate) footprint: bool,
}

impl ContourOptions {
    /// How an image of `samples` times the resolution of the pixels is drawn, so that their means blur as much as these options
    /// ask for: the step spreads by a variance of w²/5, the samples by (s² − 1)/12s² of a pixel. A sample is no less blurred
    /// than its own area makes it.
    pub(crate) fn drawing(&self, samples: usize) -> Drawing {
        let s2 = (samples * samples) as f64;
        let least = 5.0 / 12.0;
        let half_width = f64::from(self.drawn_half_width());
        let left = s2 * half_width * half_width - least * (s2 - 1.0);
        let step = match samples {
            1 => DrawStep::Smooth(self.drawn_half_width()),
            _ if left > 1.01 * least => DrawStep::Smooth(left.sqrt() as f32),
            _ => DrawStep::Square,
        };
        Drawing { step, creases: self.creases && samples == 1, footprint: samples > 1 }
    }
}

#[cfg(test)]
mod tests {
    use glam::vec2;

    use super::*;

    #[test]
    fn the_square_step_is_the_area_of_a_cut_square() {
        for angle in [0.0f32, 0.2, 0.8, 1.1, 1.6, 2.5, -2.0] {
            let normal = Vec2::from_angle(angle);
            for s in [-0.8f32, -0.6, -0.3, -0.05, 0.0, 0.11, 0.45, 0.52, 0.69] {
                let n = 1000;
                let place = |i: i32| (i as f32 + 0.5) / n as f32 - 0.5;
                let inside =
                    (0..n * n).filter(|i| normal.dot(vec2(place(i % n), place(i / n))) < -s);
                let area = inside.count() as f32 / (n * n) as f32;
                let (value, slope) = DrawStep::Square.at(s, normal);
                assert!((value - area).abs() < 2e-3, "{angle} {s}: {value} {area}");
                let d = 1e-3;
                let at = |s: f32| DrawStep::Square.at(s, normal).0;
                let difference = (at(s + d) - at(s - d)) / (2.0 * d);
                assert!((difference - slope).abs() < 2e-2, "{angle} {s}: {slope} {difference}");
            }
        }
    }

    #[test]
    fn parts_of_pixels_blur_as_much_as_the_pixel() {
        let options = ContourOptions { half_width: 1.2, creases: false };
        assert_eq!(options.drawing(1).step, DrawStep::Smooth(1.2));
        let DrawStep::Smooth(w) = options.drawing(4).step else { panic!() };
        let variance = f64::from(w * w) / 5.0 / 16.0 + 15.0 / (12.0 * 16.0);
        assert!((variance - 1.44 / 5.0).abs() < 1e-6);
        for half_width in [0.645, 0.0, -3.0] {
            assert_eq!(ContourOptions { half_width, ..options }.drawing(4).step, DrawStep::Square);
        }
        let wide = |half_width| ContourOptions { half_width, ..options }.drawing(2).step;
        assert_eq!(wide(f64::INFINITY), wide(64.0));
    }

    #[test]
    fn the_step_falls_smoothly_over_the_band() {
        let w = 1.3;
        assert_eq!(falling_step(-w, w), (1.0, 0.0));
        assert_eq!(falling_step(w, w).0, 0.0);
        assert_eq!(falling_step(0.0, w).0, 0.5);
        for s in [-1.1f32, -0.3, 0.0, 0.9] {
            let d = 1e-2;
            let difference = (falling_step(s + d, w).0 - falling_step(s - d, w).0) / (2.0 * d);
            assert!((difference - falling_step(s, w).1).abs() < 1e-3);
        }
    }
}
