//! The distortion of fisheyes.

use nalgebra::Vector2;
use prehend_autodiff::Scalar;

use super::{DistortionError, check_finite};

/// Below this squared radius θ/r is a series: the square root has no derivative at the center.
const CENTER: f64 = 1e-4;

/// The fisheye model of OpenCV (J. Kannala and S. S. Brandt, "A generic camera model and calibration method for conventional,
/// wide-angle, and fish-eye lenses", IEEE TPAMI 28, 2006).
///
/// An ideal image position (x, y) = (X/Z, Y/Z) at r = √(x² + y²), θ = atan r off the axis, appears at (x, y) θ_d/r with
/// `θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)`. Without coefficients the image is equidistant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KannalaBrandt {
    /// Coefficients k1 to k4.
    pub radial: [f64; 4],
}

impl KannalaBrandt {
    /// From OpenCV's list k1, k2, k3, k4.
    ///
    /// # Errors
    /// When the list has another length or an entry is not finite.
    pub fn from_opencv(coefficients: &[f64]) -> Result<Self, DistortionError> {
        let found = coefficients.len();
        let count = |_| DistortionError::Count { found, expected: "4" };
        let radial = coefficients.try_into().map_err(count)?;
        check_finite(coefficients)?;
        Ok(Self { radial })
    }

    /// Where the lens shows an ideal image position; both as X/Z, Y/Z. Not finite for positions beyond 1e150 and coefficients
    /// beyond 1e300.
    pub fn distort<S: Scalar>(&self, ideal: Vector2<S>) -> Vector2<S> {
        let r2 = ideal.norm_squared();
        // θ/r, and θ².
        let (ratio, squared) = match r2.value() < CENTER {
            true => {
                let tail = (r2.times(-1.0 / 7.0).plus(0.2) * r2).plus(-1.0 / 3.0);
                let ratio = (tail * r2).plus(1.0);
                (ratio, r2 * ratio * ratio)
            }
            false => {
                let r = r2.sqrt();
                let angle = r.atan();
                (angle / r, angle * angle)
            }
        };
        let [k1, k2, k3, k4] = self.radial;
        let tail = ((squared.times(k4).plus(k3) * squared).plus(k2) * squared).plus(k1);
        ideal * (ratio * (tail * squared).plus(1.0))
    }

    /// The ideal image position of what the lens shows at `seen`, by Newton's method for the angle; `None` from a right angle to
    /// the axis on, and where the model folds back.
    pub fn undistort(&self, seen: Vector2<f64>) -> Option<Vector2<f64>> {
        let wanted = seen.norm();
        if wanted == 0.0 {
            return Some(seen);
        }
        let mut angle = wanted.min(1.5);
        for _ in 0..50 {
            let (value, slope) = self.radius(angle);
            let step = (value - wanted) / slope;
            // Also false for a NaN.
            if step.abs() <= 1e-15 * (1.0 + angle) {
                let ideal = seen * (angle.tan() / wanted);
                let in_front = (0.0..std::f64::consts::FRAC_PI_2).contains(&angle);
                return (in_front && self.shows(ideal)).then_some(ideal);
            }
            angle = (angle - step).clamp(0.0, 3.2);
        }
        None
    }

    /// θ_d at θ, and its derivative.
    fn radius(&self, angle: f64) -> (f64, f64) {
        let s = angle * angle;
        let [k1, k2, k3, k4] = self.radial;
        let value = angle * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4))));
        let slope = 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * (7.0 * k3 + s * 9.0 * k4)));
        (value, slope)
    }

    /// Whether an ideal position lies before the model's fold.
    pub(super) fn shows(&self, ideal: Vector2<f64>) -> bool {
        const SAMPLES: usize = 32;
        let angle = ideal.norm().atan();
        (1..=SAMPLES).all(|i| self.radius(angle * i as f64 / SAMPLES as f64).1 > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::Fwd;
    use prehend_autodiff::check::finite_difference_jacobian;

    use super::*;

    const FISHEYE: [f64; 4] = [0.08, -0.02, 0.004, -0.0005];

    #[test]
    fn hand_values_hold() {
        let lens = KannalaBrandt::from_opencv(&FISHEYE).unwrap();
        let seen = lens.distort(Vector2::new(0.6, 0.8));
        // θ = π/4.
        let t = std::f64::consts::FRAC_PI_4;
        let d = t + 0.08 * t.powi(3) - 0.02 * t.powi(5) + 0.004 * t.powi(7) - 0.0005 * t.powi(9);
        assert!((seen - Vector2::new(0.6, 0.8) * d).norm() < 1e-15);
        assert_eq!(lens.distort(Vector2::<f64>::zeros()), Vector2::zeros());
    }

    #[test]
    fn undistorting_undoes_distorting() {
        let lens = KannalaBrandt::from_opencv(&FISHEYE).unwrap();
        for i in 0..400 {
            let ideal = Vector2::new((i % 20) as f64 - 9.5, (i / 20) as f64 - 9.5) * 0.3;
            let back = lens.undistort(lens.distort(ideal)).unwrap();
            assert!((back - ideal).norm() < 1e-12 * (1.0 + ideal.norm_squared()), "{ideal} {back}");
        }
        assert_eq!(lens.undistort(Vector2::zeros()), Some(Vector2::zeros()));
        // 91° off the axis.
        let (beyond, _) = lens.radius(1.588);
        assert_eq!(lens.undistort(Vector2::new(beyond, 0.0)), None);
        assert_eq!(lens.undistort(Vector2::new(f64::NAN, 0.0)), None);
        let folding = KannalaBrandt::from_opencv(&[-0.4, 0.0, 0.0, 0.0]).unwrap();
        assert!(!folding.shows(Vector2::new(1.4, 0.0)) && folding.shows(Vector2::new(0.9, 0.0)));
    }

    #[test]
    fn derivatives_match_differences_at_the_center_too() {
        let lens = KannalaBrandt::from_opencv(&FISHEYE).unwrap();
        for at in [[0.0, 0.0], [1e-5, -2e-5], [0.008, 0.006], [0.0099, 0.001], [0.7, -1.1]] {
            let [x, y] = Fwd::<2>::variables(at);
            let seen = lens.distort(Vector2::new(x, y));
            let plain = |x: &[f64]| lens.distort(Vector2::new(x[0], x[1])).as_slice().to_vec();
            for (row, reference) in finite_difference_jacobian(plain, &at, 1e-5).iter().enumerate()
            {
                for (exact, difference) in seen[row].derivative.iter().zip(reference) {
                    assert!((exact - difference).abs() < 1e-9, "{at:?} {exact} {difference}");
                }
            }
        }
    }

    #[test]
    fn bad_coefficients_are_errors() {
        let count = KannalaBrandt::from_opencv(&[0.1; 5]);
        assert_eq!(count.unwrap_err().to_string(), "5 distortion coefficients, expected 4");
        let nan = KannalaBrandt::from_opencv(&[0.1, f64::NAN, 0.0, 0.0]);
        assert!(matches!(nan, Err(DistortionError::NotFinite { index: 1, .. })));
    }
}
