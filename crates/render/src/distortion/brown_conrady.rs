//! The radial–tangential distortion of ordinary lenses.

use nalgebra::{Matrix2, Vector2};
use prehend_autodiff::{Fwd, Scalar};

use super::{DistortionError, check_finite};

/// The radial–tangential distortion of OpenCV ("Camera calibration and 3D reconstruction"; D. C. Brown, "Close-range camera
/// calibration", 1971).
///
/// An ideal image position (x, y) = (X/Z, Y/Z) with r² = x² + y² appears at
/// `x c + 2 p1 x y + p2 (r² + 2 x²)`, `y c + p1 (r² + 2 y²) + 2 p2 x y`,
/// `c = (1 + k1 r² + k2 r⁴ + k3 r⁶)/(1 + k4 r² + k5 r⁴ + k6 r⁶)`. The default is none.
///
/// ```
/// use nalgebra::Vector2;
/// use prehend_render::BrownConrady;
///
/// let lens = BrownConrady::from_opencv(&[-0.3, 0.1, 1e-3, -5e-4, 0.0])?;
/// let seen = lens.distort(Vector2::new(0.4, -0.2));
/// assert!((lens.undistort(seen).unwrap() - Vector2::new(0.4, -0.2)).norm() < 1e-12);
/// # Ok::<(), prehend_render::DistortionError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BrownConrady {
    /// Radial coefficients k1 to k6.
    pub radial: [f64; 6],
    /// Tangential coefficients p1, p2.
    pub tangential: [f64; 2],
}

impl BrownConrady {
    /// From OpenCV's list k1, k2, p1, p2\[, k3\[, k4, k5, k6\]\]; an empty list is no distortion.
    ///
    /// # Errors
    /// When the list has another length or an entry is not finite.
    pub fn from_opencv(coefficients: &[f64]) -> Result<Self, DistortionError> {
        let c = coefficients;
        if ![0, 4, 5, 8].contains(&c.len()) {
            return Err(DistortionError::Count { found: c.len(), expected: "0, 4, 5 or 8" });
        }
        check_finite(c)?;
        let at = |i: usize| c.get(i).copied().unwrap_or(0.0);
        let radial = [at(0), at(1), at(4), at(5), at(6), at(7)];
        Ok(Self { radial, tangential: [at(2), at(3)] })
    }

    /// OpenCV's list k1, k2, p1, p2, k3, k4, k5, k6.
    pub fn to_opencv(&self) -> [f64; 8] {
        let [k1, k2, k3, k4, k5, k6] = self.radial;
        let [p1, p2] = self.tangential;
        [k1, k2, p1, p2, k3, k4, k5, k6]
    }

    /// Where the lens shows an ideal image position; both as X/Z, Y/Z. Not finite where the denominator vanishes or powers
    /// leave the range of numbers, which lies beyond the fold.
    pub fn distort<S: Scalar>(&self, ideal: Vector2<S>) -> Vector2<S> {
        let (x, y) = (ideal.x, ideal.y);
        let r2 = x * x + y * y;
        let [k1, k2, k3, k4, k5, k6] = self.radial;
        let [p1, p2] = self.tangential;
        let cubic = |a: f64, b: f64, c: f64| ((r2.times(c).plus(b) * r2).plus(a) * r2).plus(1.0);
        let scale = cubic(k1, k2, k3) / cubic(k4, k5, k6);
        let xy = (x * y).times(2.0);
        Vector2::new(
            x * scale + xy.times(p1) + (r2 + (x * x).times(2.0)).times(p2),
            y * scale + (r2 + (y * y).times(2.0)).times(p1) + xy.times(p2),
        )
    }

    /// The ideal image position of what the lens shows at `seen`, by Newton's method; `None` where the model shows
    /// nothing there, or what lies beyond the point at which it folds back.
    pub fn undistort(&self, seen: Vector2<f64>) -> Option<Vector2<f64>> {
        let mut ideal = seen;
        for _ in 0..50 {
            let (value, slope) = self.linearize(ideal);
            let residual = value - seen;
            // Also false for a NaN.
            if residual.norm() <= 1e-14 * (1.0 + seen.norm()) {
                return self.shows(ideal).then_some(ideal);
            }
            let step = slope.try_inverse()? * residual;
            let improves =
                |t: f64| (self.distort(ideal - step * t) - seen).norm() < residual.norm();
            // Halved until it helps: far out a whole step may jump over the fold.
            let Some(length) = (0..30).map(|i| 0.5f64.powi(i)).find(|t| improves(*t)) else {
                let good = residual.norm() <= 1e-10 * (1.0 + seen.norm());
                return (good && self.shows(ideal)).then_some(ideal);
            };
            ideal -= step * length;
        }
        None
    }

    /// Whether an ideal position lies before the model's fold: beyond it the same content would show again, mirrored.
    pub(super) fn shows(&self, ideal: Vector2<f64>) -> bool {
        const SAMPLES: usize = 32;
        let r2 = ideal.norm_squared();
        // The derivative here is not enough: it changes its sign again where the factor does, and at a second fold.
        let rises = |i: usize| self.radius_rises(r2 * (i as f64 / SAMPLES as f64).powi(2));
        self.linearize(ideal).1.determinant() > 0.0 && (1..=SAMPLES).all(rises)
    }

    /// Whether the seen radius grows with the ideal one where that squared is `s`.
    fn radius_rises(&self, s: f64) -> bool {
        let [k1, k2, k3, k4, k5, k6] = self.radial;
        let cubic = |a: f64, b: f64, c: f64| 1.0 + s * (a + s * (b + s * c));
        let slope = |a: f64, b: f64, c: f64| a + s * (2.0 * b + s * 3.0 * c);
        let (top, bottom) = (cubic(k1, k2, k3), cubic(k4, k5, k6));
        let turn = slope(k1, k2, k3) * bottom - top * slope(k4, k5, k6);
        // d(r t/b)/dr = (t b + 2 r² (t' b − t b')) / b², with t and b as functions of r².
        bottom > 0.0 && top * bottom + 2.0 * s * turn > 0.0
    }

    fn linearize(&self, ideal: Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let [x, y] = Fwd::<2>::variables([ideal.x, ideal.y]);
        let seen = self.distort(Vector2::new(x, y));
        (seen.map(|v| v.value), Matrix2::from_fn(|i, j| seen[i].derivative[j]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDE: [f64; 5] = [-0.31, 0.11, 1.2e-3, -7e-4, -0.02];

    #[test]
    fn hand_values_hold() {
        // r² = 0.25; c = 1 + 0.4·0.25 + 0.2·0.0625 − 0.1·0.015625 over 1 + 0.1·0.25.
        let lens = BrownConrady::from_opencv(&[0.4, 0.2, 0.01, 0.02, -0.1, 0.1, 0.0, 0.0]).unwrap();
        let c = (1.0 + 0.1 + 0.0125 - 0.0015625) / 1.025;
        let seen = lens.distort(Vector2::new(0.3, 0.4));
        let x = 0.3 * c + 2.0 * 0.01 * 0.12 + 0.02 * (0.25 + 0.18);
        let y = 0.4 * c + 0.01 * (0.25 + 0.32) + 2.0 * 0.02 * 0.12;
        assert!((seen - Vector2::new(x, y)).norm() < 1e-15);
        let none = BrownConrady::from_opencv(&[]).unwrap();
        assert_eq!(none.distort(seen), seen);
        assert_eq!(none.undistort(seen), Some(seen));
    }

    #[test]
    fn undistorting_undoes_distorting() {
        let rational = [0.5, 0.1, 1e-3, -1e-3, 0.02, 0.8, 0.2, 0.03];
        for coefficients in [WIDE.as_slice(), &WIDE[..4], &rational] {
            let lens = BrownConrady::from_opencv(coefficients).unwrap();
            for i in 0..400 {
                let ideal = Vector2::new((i % 20) as f64 - 9.5, (i / 20) as f64 - 9.5) * 0.06;
                let back = lens.undistort(lens.distort(ideal)).unwrap();
                assert!((back - ideal).norm() < 1e-9, "{ideal} {back}");
            }
        }
    }

    #[test]
    fn nothing_lies_beyond_the_fold() {
        // x (1 − 0.4 x²) is 0.609 at most.
        let lens = BrownConrady::from_opencv(&[-0.4, 0.0, 0.0, 0.0]).unwrap();
        assert!(lens.undistort(Vector2::new(0.6, 0.0)).is_some());
        assert!(lens.undistort(Vector2::new(0.62, 0.0)).is_none());
        assert!(lens.undistort(Vector2::new(f64::NAN, 0.0)).is_none());
    }

    #[test]
    fn bad_coefficients_are_errors() {
        let count = BrownConrady::from_opencv(&[0.1; 6]);
        assert_eq!(
            count.unwrap_err().to_string(),
            "6 distortion coefficients, expected 0, 4, 5 or 8"
        );
        let nan = BrownConrady::from_opencv(&[0.1, f64::NAN, 0.0, 0.0]);
        assert!(matches!(nan, Err(DistortionError::NotFinite { index: 1, .. })));
    }
}
