//! Why a body cannot be simulated.

use thiserror::Error;

/// Why a body cannot be simulated.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum BodyError {
    /// The mass is not a positive number.
    #[error("mass must be positive and finite, is {0} kg")]
    Mass(f64),
    /// The inertia is not symmetric and positive definite.
    #[error("inertia must be symmetric and positive definite")]
    Inertia,
    /// No body has such an inertia: a principal moment is larger than the other two together.
    #[error(
        "no body has principal moments of inertia {moments:?} kg m²: the largest is at most the sum of the others"
    )]
    Moments {
        /// The principal moments, in ascending order \[kg m²\].
        moments: [f64; 3],
    },
    /// The center of mass is not finite.
    #[error("center of mass must be finite")]
    CenterOfMass,
    /// Points and areas differ in number.
    #[error("{points} surface points but {areas} areas")]
    Samples {
        /// Number of points.
        points: usize,
        /// Number of areas.
        areas: usize,
    },
    /// A length of a box or the radius of a ball is not positive and finite.
    #[error("lengths must be positive and finite, one is {0} m")]
    Length(f64),
    /// The edges of a box are not round, or leave nothing of its faces.
    #[error("edges of a box must be round and leave something of its faces, their radius is {0} m")]
    Edges(f64),
    /// The radius of rounded samples is negative or not finite.
    #[error("radius of surface points must be zero or positive and finite, is {0} m")]
    Rounding(f64),
    /// There are no surface points, so nothing would ever touch.
    #[error("no surface points")]
    NoSamples,
    /// A surface point is not finite, or stands for no area.
    #[error("surface point {index} must be finite and of positive area")]
    Sample {
        /// Its place.
        index: usize,
    },
}

/// Whether all `lengths` \[m\] are positive and finite.
pub(crate) fn check_lengths(lengths: &[f64]) -> Result<(), BodyError> {
    match lengths.iter().find(|x| !(**x > 0.0 && x.is_finite())) {
        Some(&length) => Err(BodyError::Length(length)),
        None => Ok(()),
    }
}
