//! Why a body cannot be simulated.

use thiserror::Error;

use crate::magnitude::{LARGEST, SMALLEST};

/// Why a body cannot be simulated.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum BodyError {
    /// The mass is not a positive number.
    #[error("mass must be positive and finite, is {0} kg")]
    Mass(f64),
    /// The inertia is not symmetric and positive definite, or so small that it has no inverse.
    #[error(
        "inertia must be symmetric and positive definite, and not so small that it has no inverse"
    )]
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
    /// A length of a box or the radius of a ball is not positive and finite, or beyond all measure.
    #[error("lengths must be from 1e-60 to 1e60 m, one is {0} m")]
    Length(f64),
    /// Samples so close that there is no memory for them.
    #[error("samples {0} m apart would be more than ten million")]
    Spacing(f64),
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

/// True if a length \[m\] is positive, and neither the fifth power of its inverse nor its own overflows, as moments of inertia of a density have it.
pub(crate) fn is_length(length: f64) -> bool {
    (SMALLEST..=LARGEST).contains(&length)
}

/// Checks that all `lengths` \[m\] are positive and finite.
pub(crate) fn check_lengths(lengths: &[f64]) -> Result<(), BodyError> {
    match lengths.iter().find(|x| !is_length(**x)) {
        Some(&length) => Err(BodyError::Length(length)),
        None => Ok(()),
    }
}
