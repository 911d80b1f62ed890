//! Lens distortion, and images with and without it.

mod brown_conrady;
mod kannala_brandt;
mod remap;

use nalgebra::Vector2;
use prehend_autodiff::Scalar;

pub use brown_conrady::BrownConrady;
pub use kannala_brandt::KannalaBrandt;
pub use remap::Remap;

use crate::image::ImageError;

/// How a lens shows what a pinhole would show elsewhere. Positions are X/Z, Y/Z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// Of ordinary lenses.
    BrownConrady(BrownConrady),
    /// Of fisheyes.
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

impl From<BrownConrady> for Distortion {
    fn from(lens: BrownConrady) -> Self {
        Self::BrownConrady(lens)
    }
}

impl From<KannalaBrandt> for Distortion {
    fn from(lens: KannalaBrandt) -> Self {
        Self::KannalaBrandt(lens)
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
