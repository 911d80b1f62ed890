//! Lens distortion, and images with and without it.

mod brown_conrady;
mod kannala_brandt;
mod remap;

use nalgebra::Vector2;
use prehend_autodiff::Scalar;

pub use brown_conrady::BrownConrady;
pub use kannala_brandt::KannalaBrandt;
pub use remap::Remap;

use crate::camera::Camera;
use crate::image::ImageError;

/// How a lens shows what a pinhole would show elsewhere. Positions are X/Z, Y/Z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// Radial–tangential distortion of ordinary lenses.
    BrownConrady(BrownConrady),
    /// Distortion of fisheyes.
    KannalaBrandt(KannalaBrandt),
}

impl Distortion {
    /// The model called `name`, `"brown_conrady"` or `"kannala_brandt"`, with its coefficients in the order of OpenCV.
    ///
    /// ```
    /// use nalgebra::Vector2;
    /// use prehend_render::Distortion;
    ///
    /// let fisheye = Distortion::by_name("kannala_brandt", &[0.05, -0.01, 0.0, 0.0])?;
    /// let ideal = Vector2::new(1.2, -0.7);
    /// assert!((fisheye.undistort(fisheye.distort(ideal)).unwrap() - ideal).norm() < 1e-12);
    /// # Ok::<(), prehend_render::DistortionError>(())
    /// ```
    ///
    /// # Errors
    /// When there is no such model, it has another number of coefficients, or one is not finite.
    pub fn by_name(name: &str, coefficients: &[f64]) -> Result<Self, DistortionError> {
        match name {
            "brown_conrady" => BrownConrady::from_opencv(coefficients).map(Self::BrownConrady),
            "kannala_brandt" => KannalaBrandt::from_opencv(coefficients).map(Self::KannalaBrandt),
            _ => Err(DistortionError::Model { name: name.to_owned() }),
        }
    }

    /// The name that [`by_name`](Self::by_name) takes.
    pub fn name(&self) -> &'static str {
        match self {
            Self::BrownConrady(_) => "brown_conrady",
            Self::KannalaBrandt(_) => "kannala_brandt",
        }
    }

    /// The coefficients in the order of OpenCV.
    pub fn coefficients(&self) -> Vec<f64> {
        match self {
            Self::BrownConrady(lens) => lens.to_opencv().to_vec(),
            Self::KannalaBrandt(lens) => lens.radial.to_vec(),
        }
    }

    /// A pinhole camera of the focal lengths of `camera` whose image contains that of `camera`, and all of what this sees behind the lens up to
    /// the corners of its pixels; but no more than `widest` times as many columns and rows: nearly a right angle off the axis, a pinhole's image
    /// has no end. What [`Remap::distort`] makes images from.
    pub fn pinhole_that_covers(&self, camera: &Camera, widest: f64) -> Camera {
        let &Camera { fx, fy, cx, cy, width, height } = camera;
        let reach = |size: usize| 0.5 * (widest - 1.0).max(0.0) * size as f64;
        let (mut low, mut high) = ([0.0; 2], [width, height].map(|size| size as f64 - 1.0));
        let most = [width, height].map(|size| (-reach(size), size as f64 - 1.0 + reach(size)));
        let across = width + 1;
        let corners =
            (0..across * (height + 1)).map(|at| [at % across, at / across].map(|v| v as f64 - 0.5));
        for ideal in corners.filter_map(|[u, v]| self.undistort(camera.ray(u, v).xy())) {
            let seen = [fx * ideal.x + cx, fy * ideal.y + cy];
            for k in 0..2 {
                let at = seen[k].clamp(most[k].0, most[k].1);
                (low[k], high[k]) = (at.min(low[k]), at.max(high[k]));
            }
        }
        let size = |k: usize| ((high[k].ceil() - low[k].floor()) as usize).saturating_add(1);
        let [left, top] = low.map(f64::floor);
        Camera { cx: cx - left, cy: cy - top, width: size(0), height: size(1), ..*camera }
    }

    /// Where the lens shows an ideal image position.
    pub fn distort<S: Scalar>(&self, ideal: Vector2<S>) -> Vector2<S> {
        match self {
            Self::BrownConrady(lens) => lens.distort(ideal),
            Self::KannalaBrandt(lens) => lens.distort(ideal),
        }
    }

    /// The ideal image position of what the lens shows at `seen`; `None` where the model shows nothing there, or what lies beyond
    /// the point at which it folds back.
    pub fn undistort(&self, seen: Vector2<f64>) -> Option<Vector2<f64>> {
        match self {
            Self::BrownConrady(lens) => lens.undistort(seen),
            Self::KannalaBrandt(lens) => lens.undistort(seen),
        }
    }

    /// Whether an ideal position lies before the model's fold.
    fn shows(&self, ideal: Vector2<f64>) -> bool {
        match self {
            Self::BrownConrady(lens) => lens.shows(ideal),
            Self::KannalaBrandt(lens) => lens.shows(ideal),
        }
    }
}

/// Why distortion could not be described or removed.
#[derive(Debug, thiserror::Error)]
pub enum DistortionError {
    /// No model of this name.
    #[error("no distortion model is called {name:?}: one of brown_conrady, kannala_brandt")]
    Model {
        /// The name.
        name: String,
    },
    /// Not a number of coefficients that OpenCV writes for the model.
    #[error("{found} distortion coefficients, expected {expected}")]
    Count {
        /// Coefficients given.
        found: usize,
        /// How many the model has.
        expected: &'static str,
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

fn check_finite(coefficients: &[f64]) -> Result<(), DistortionError> {
    match coefficients.iter().enumerate().find(|(_, value)| !value.is_finite()) {
        Some((index, &value)) => Err(DistortionError::NotFinite { index, value }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lens_is_told_by_name_and_coefficients() {
        let lenses: [(&str, &[f64]); 2] = [
            ("brown_conrady", &[-0.3, 0.1, 2e-3, -1e-3, -0.02, 0.01, -0.02, 0.03]),
            ("kannala_brandt", &[0.02, -0.01, 0.002, 1e-4]),
        ];
        for (name, coefficients) in lenses {
            let lens = Distortion::by_name(name, coefficients).unwrap();
            assert_eq!((lens.name(), lens.coefficients().as_slice()), (name, coefficients));
        }
    }

    #[test]
    fn the_pinhole_covers_what_the_lens_shows() {
        let camera = Camera { fx: 60.0, fy: 62.0, cx: 39.0, cy: 31.0, width: 80, height: 60 };
        let barrel = Distortion::by_name("brown_conrady", &[-0.25, 0.05, 2e-3, 0.0]).unwrap();
        let wide = barrel.pinhole_that_covers(&camera, 4.0);
        assert!(wide.width > 90 && wide.height > 65, "{wide:?}");
        let [mut least, mut most] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for at in 0..81 * 61 {
            let ray = camera.ray((at % 81) as f64 - 0.5, (at / 81) as f64 - 0.5).xy();
            let ideal = barrel.undistort(ray).unwrap();
            let seen = [wide.fx * ideal.x + wide.cx, wide.fy * ideal.y + wide.cy];
            for k in 0..2 {
                (least[k], most[k]) = (least[k].min(seen[k]), most[k].max(seen[k]));
            }
        }
        let size = [wide.width, wide.height].map(|size| size as f64 - 1.0);
        assert!((0..2).all(|k| (0.0..1.0).contains(&least[k])), "{least:?}");
        assert!((0..2).all(|k| (0.0..1.0).contains(&(size[k] - most[k]))), "{most:?}");
        // A fisheye may show what no pinhole can.
        let fisheye = Distortion::by_name("kannala_brandt", &[0.0; 4]).unwrap();
        let short = Camera { fx: 24.0, fy: 24.0, ..camera };
        assert_eq!(fisheye.pinhole_that_covers(&short, 3.0).width, 240);
    }
}
