//! The smooth step across contours.

use nalgebra::{RealField, convert};

/// The smooth step from 1 at −w to 0 at +w, and its derivative.
#[inline]
pub(crate) fn falling_step<T: RealField + Copy>(s: T, w: T) -> (T, T) {
    let (one, two, three): (T, T, T) = (T::one(), convert(2.0), convert(3.0));
    let x = ((w - s) / (two * w)).clamp(T::zero(), one);
    (x * x * (three - two * x), -three * x * (one - x) / w)
}

#[cfg(test)]
mod tests {
    use super::*;

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
