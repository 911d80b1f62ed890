//! Lens distortion of input images, and its removal.

use nalgebra::{Matrix2, Vector2};
use prehend_autodiff::{Fwd, Scalar};

use crate::camera::Camera;
use crate::image::{DepthImage, ImageError, Mask, RgbImage};

/// The radial–tangential distortion of OpenCV ("Camera calibration and 3D reconstruction"; D. C. Brown, "Close-range camera
/// calibration", 1971).
///
/// An ideal image position (x, y) = (X/Z, Y/Z) with r² = x² + y² appears at
/// `x c + 2 p1 x y + p2 (r² + 2 x²)`, `y c + p1 (r² + 2 y²) + 2 p2 x y`,
/// `c = (1 + k1 r² + k2 r⁴ + k3 r⁶)/(1 + k4 r² + k5 r⁴ + k6 r⁶)`. The default is none.
///
/// ```
/// use nalgebra::Vector2;
/// use prehend_render::Distortion;
///
/// let lens = Distortion::from_opencv(&[-0.3, 0.1, 1e-3, -5e-4, 0.0])?;
/// let seen = lens.distort(Vector2::new(0.4, -0.2));
/// assert!((lens.undistort(seen).unwrap() - Vector2::new(0.4, -0.2)).norm() < 1e-12);
/// # Ok::<(), prehend_render::DistortionError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// Radial coefficients k1 to k6.
    pub radial: [f64; 6],
    /// Tangential coefficients p1, p2.
    pub tangential: [f64; 2],
}

/// Why distortion could not be described or removed.
#[derive(Debug, thiserror::Error)]
pub enum DistortionError {
    /// Not a number of coefficients that OpenCV writes for this model.
    #[error("{found} distortion coefficients, expected 0, 4, 5 or 8")]
    Count {
        /// Coefficients given.
        found: usize,
    },
    /// A coefficient is infinite or not a number.
    #[error("distortion coefficient {index} is {value}, expected a finite number")]
    NotFinite {
        /// Its place.
        index: usize,
        /// The coefficient.
        value: f64,
    },
    /// An image does not have the size of its camera.
    #[error("image of {found_width} x {found_height}, but its camera has {width} x {height}")]
    Size {
        /// Columns of the image.
        found_width: usize,
        /// Rows of the image.
        found_height: usize,
        /// Columns of the camera.
        width: usize,
        /// Rows of the camera.
        height: usize,
    },
    /// The result could not be built.
    #[error(transparent)]
    Image(#[from] ImageError),
}

impl Distortion {
    /// From OpenCV's list k1, k2, p1, p2\[, k3\[, k4, k5, k6\]\]; an empty list is no distortion.
    ///
    /// # Errors
    /// When the list has another length or an entry is not finite.
    pub fn from_opencv(coefficients: &[f64]) -> Result<Self, DistortionError> {
        let c = coefficients;
        if ![0, 4, 5, 8].contains(&c.len()) {
            return Err(DistortionError::Count { found: c.len() });
        }
        if let Some((index, &value)) = c.iter().enumerate().find(|(_, v)| !v.is_finite()) {
            return Err(DistortionError::NotFinite { index, value });
        }
        let at = |i: usize| c.get(i).copied().unwrap_or(0.0);
        let radial = [at(0), at(1), at(4), at(5), at(6), at(7)];
        Ok(Self { radial, tangential: [at(2), at(3)] })
    }

    /// Where the lens shows an ideal image position; both as X/Z, Y/Z.
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
                return self.shows(ideal, &slope).then_some(ideal);
            }
            let step = slope.try_inverse()? * residual;
            let improves =
                |t: f64| (self.distort(ideal - step * t) - seen).norm() < residual.norm();
            // Halved until it helps: far out a whole step may jump over the fold.
            let Some(length) = (0..30).map(|i| 0.5f64.powi(i)).find(|t| improves(*t)) else {
                let good = residual.norm() <= 1e-10 * (1.0 + seen.norm());
                return (good && self.shows(ideal, &slope)).then_some(ideal);
            };
            ideal -= step * length;
        }
        None
    }

    /// Whether an ideal position, at which the derivative is `slope`, lies before the model's fold: beyond it the same content
    /// would show again, mirrored.
    fn shows(&self, ideal: Vector2<f64>, slope: &Matrix2<f64>) -> bool {
        const SAMPLES: usize = 32;
        let r2 = ideal.norm_squared();
        // The derivative here is not enough: it changes its sign again where the factor does, and at a second fold.
        let rises = |i: usize| self.radius_rises(r2 * (i as f64 / SAMPLES as f64).powi(2));
        slope.determinant() > 0.0 && (1..=SAMPLES).all(rises)
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

/// Makes pinhole images of images through a lens: where each pixel comes from, computed once.
#[derive(Clone, Debug)]
pub struct Undistortion {
    source: Camera,
    target: Camera,
    /// Position in the source image of each pixel \[px\]; NaN where there is none.
    place: Vec<[f32; 2]>,
}

impl Undistortion {
    /// From images of a camera `source` behind the lens `distortion` to those of the pinhole camera `target`, which looks
    /// from the same place in the same direction. Crop and focal lengths of `target` are free: the source's own are good.
    pub fn new(source: Camera, distortion: &Distortion, target: Camera) -> Self {
        let place = |at: usize| {
            let (u, v) = ((at % target.width) as f64, (at / target.width) as f64);
            let (seen, slope) = distortion.linearize(target.ray(u, v).xy());
            match distortion.shows(target.ray(u, v).xy(), &slope) {
                true => [source.fx * seen.x + source.cx, source.fy * seen.y + source.cy]
                    .map(|p| p as f32),
                false => [f32::NAN; 2],
            }
        };
        let place = (0..target.width * target.height).map(place).collect();
        Self { source, target, place }
    }

    /// The camera of the images made.
    pub fn camera(&self) -> &Camera {
        &self.target
    }

    /// Colors, interpolated bilinearly; black beyond the source's image.
    ///
    /// # Errors
    /// When the image does not have the size of the source camera.
    pub fn rgb(&self, image: &RgbImage) -> Result<RgbImage, DistortionError> {
        self.check(image.width(), image.height())?;
        let pixel = |&[x, y]: &[f32; 2]| {
            let inside = |p: f32, size: usize| (-0.5..=size as f32 - 0.5).contains(&p);
            if !(inside(x, image.width()) && inside(y, image.height())) {
                return [0.0; 3];
            }
            // The outer half of a border pixel has the color of its center.
            let cell = |p: f32, size: usize| {
                let p = p.clamp(0.0, size as f32 - 1.0);
                let low = p as usize;
                (p - low as f32, low, (low + 1).min(size - 1))
            };
            let (a, x0, x1) = cell(x, image.width());
            let (b, y0, y1) = cell(y, image.height());
            let at = |x: usize, y: usize| image.pixels()[y * image.width() + x];
            let (p, q, r, s) = (at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1));
            [0, 1, 2].map(|k| {
                (1.0 - b) * ((1.0 - a) * p[k] + a * q[k]) + b * ((1.0 - a) * r[k] + a * s[k])
            })
        };
        let pixels = self.place.iter().map(pixel).collect();
        Ok(RgbImage::new(self.target.width, self.target.height, pixels)?)
    }

    /// Depths (Z, which a lens does not change), each of the nearest pixel: a mean of near and far would lie on
    /// neither. 0 beyond the source's image.
    ///
    /// # Errors
    /// When the image does not have the size of the source camera.
    pub fn depth(&self, image: &DepthImage) -> Result<DepthImage, DistortionError> {
        let pixels = self.nearest(image.width(), image.height(), image.pixels(), 0.0)?;
        Ok(DepthImage::new(self.target.width, self.target.height, pixels)?)
    }

    /// A mask, each pixel of the nearest; empty beyond the source's image.
    ///
    /// # Errors
    /// When the mask does not have the size of the source camera.
    pub fn mask(&self, image: &Mask) -> Result<Mask, DistortionError> {
        let pixels = self.nearest(image.width(), image.height(), image.pixels(), false)?;
        Ok(Mask::new(self.target.width, self.target.height, pixels)?)
    }

    fn nearest<T: Copy>(
        &self,
        width: usize,
        height: usize,
        pixels: &[T],
        outside: T,
    ) -> Result<Vec<T>, DistortionError> {
        self.check(width, height)?;
        let pixel = |&[x, y]: &[f32; 2]| {
            let index = |p: f32, size: usize| {
                let p = (p + 0.5).floor();
                (p >= 0.0 && p < size as f32).then_some(p as usize)
            };
            match (index(x, width), index(y, height)) {
                (Some(x), Some(y)) => pixels[y * width + x],
                _ => outside,
            }
        };
        Ok(self.place.iter().map(pixel).collect())
    }

    fn check(&self, found_width: usize, found_height: usize) -> Result<(), DistortionError> {
        let (width, height) = (self.source.width, self.source.height);
        if (found_width, found_height) == (width, height) {
            return Ok(());
        }
        Err(DistortionError::Size { found_width, found_height, width, height })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDE: [f64; 5] = [-0.31, 0.11, 1.2e-3, -7e-4, -0.02];

    #[test]
    fn hand_values_hold() {
        // r² = 0.25; c = 1 + 0.4·0.25 + 0.2·0.0625 − 0.1·0.015625 over 1 + 0.1·0.25.
        let lens = Distortion::from_opencv(&[0.4, 0.2, 0.01, 0.02, -0.1, 0.1, 0.0, 0.0]).unwrap();
        let c = (1.0 + 0.1 + 0.0125 - 0.0015625) / 1.025;
        let seen = lens.distort(Vector2::new(0.3, 0.4));
        let x = 0.3 * c + 2.0 * 0.01 * 0.12 + 0.02 * (0.25 + 0.18);
        let y = 0.4 * c + 0.01 * (0.25 + 0.32) + 2.0 * 0.02 * 0.12;
        assert!((seen - Vector2::new(x, y)).norm() < 1e-15);
        let none = Distortion::from_opencv(&[]).unwrap();
        assert_eq!(none.distort(seen), seen);
        assert_eq!(none.undistort(seen), Some(seen));
    }

    #[test]
    fn undistorting_undoes_distorting() {
        let rational = [0.5, 0.1, 1e-3, -1e-3, 0.02, 0.8, 0.2, 0.03];
        for coefficients in [WIDE.as_slice(), &WIDE[..4], &rational] {
            let lens = Distortion::from_opencv(coefficients).unwrap();
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
        let lens = Distortion::from_opencv(&[-0.4, 0.0, 0.0, 0.0]).unwrap();
        assert!(lens.undistort(Vector2::new(0.6, 0.0)).is_some());
        assert!(lens.undistort(Vector2::new(0.62, 0.0)).is_none());
        assert!(lens.undistort(Vector2::new(f64::NAN, 0.0)).is_none());
        let camera = Camera { fx: 10.0, fy: 10.0, cx: 19.5, cy: 0.0, width: 40, height: 1 };
        let made = Undistortion::new(camera, &lens, camera);
        let picture = made.rgb(&RgbImage::filled(40, 1, [1.0; 3])).unwrap();
        // Beyond x = 1.58 the factor is negative, and the derivative positive again.
        assert_eq!([0, 3, 36, 39].map(|x| picture.get(x, 0)), [Some([0.0; 3]); 4]);
        // The fold is at x = 0.913.
        assert_eq!((picture.get(28, 0), picture.get(29, 0)), (Some([1.0; 3]), Some([0.0; 3])));
    }

    #[test]
    fn straight_lines_become_straight() {
        // A photograph of the half-plane 2x + y < 0.1, and of a ramp along x.
        let camera = Camera { fx: 80.0, fy: 82.0, cx: 40.2, cy: 29.7, width: 80, height: 60 };
        let lens = Distortion::from_opencv(&WIDE).unwrap();
        let ideal = |at: usize| {
            lens.undistort(camera.ray((at % 80) as f64, (at / 80) as f64).xy()).unwrap()
        };
        let count = 80 * 60;
        let ramp = (0..count).map(|at| [0.5 + 0.5 * ideal(at).x as f32; 3]).collect();
        let half = |p: Vector2<f64>| 2.0 * p.x + p.y < 0.1;
        let mask = (0..count).map(|at| half(ideal(at))).collect();
        let depth = (0..count).map(|at| if half(ideal(at)) { 0.4 } else { 0.8 }).collect();
        let made = Undistortion::new(camera, &lens, camera);
        let ramp = made.rgb(&RgbImage::new(80, 60, ramp).unwrap()).unwrap();
        let mask = made.mask(&Mask::new(80, 60, mask).unwrap()).unwrap();
        let depth = made.depth(&DepthImage::new(80, 60, depth).unwrap()).unwrap();
        for y in 4..56 {
            for x in 4..76 {
                let p = made.camera().ray(x as f64, y as f64).xy();
                let color = ramp.get(x, y).unwrap()[0];
                assert!((color - 0.5 - 0.5 * p.x as f32).abs() < 1e-3, "{x} {y}");
                if (2.0 * p.x + p.y - 0.1).abs() > 0.03 {
                    assert_eq!(mask.get(x, y), Some(half(p)));
                    assert_eq!(depth.get(x, y), Some(if half(p) { 0.4 } else { 0.8 }));
                }
            }
        }
    }

    #[test]
    fn bad_input_is_an_error() {
        let count = Distortion::from_opencv(&[0.1; 6]);
        assert!(matches!(count, Err(DistortionError::Count { found: 6 })));
        let nan = Distortion::from_opencv(&[0.1, f64::NAN, 0.0, 0.0]);
        assert!(matches!(nan, Err(DistortionError::NotFinite { index: 1, .. })));
        let camera = Camera { fx: 8.0, fy: 8.0, cx: 4.0, cy: 3.0, width: 8, height: 6 };
        let made = Undistortion::new(camera, &Distortion::default(), camera);
        let wrong = made.rgb(&RgbImage::filled(8, 7, [0.0; 3]));
        assert!(matches!(wrong, Err(DistortionError::Size { found_height: 7, .. })));
    }
}
