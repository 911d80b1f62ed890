//! Where the samples of a distance grid lie.

use nalgebra::{Point3, Vector3};

/// Farthest position \[m\], whose squares are well within range.
pub(super) const FARTHEST: f64 = 1e100;

/// Largest number of samples a grid may have: half a gigabyte.
pub const MAX_SAMPLES: usize = 64 << 20;

/// Why a grid cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SdfError {
    /// A length is not usable.
    #[error("{name} of the distance grid is {value} m, but must be {requirement}")]
    Length {
        /// "spacing", "margin", "band" or "offset".
        name: &'static str,
        /// Value given \[m\].
        value: f64,
        /// Requirement that it breaks, such as `finite and not negative`.
        requirement: &'static str,
    },
    /// The box around the shape is not finite or turned around.
    #[error("the box around the shape is not finite or has a negative size")]
    Bounds,
    /// A sample is not at a finite position, or farther than 1e100 m from the origin.
    #[error("the distance grid is not at a finite position within 1e100 m")]
    Origin,
    /// Fewer than two samples along an axis.
    #[error("the distance grid has {count} samples along axis {axis}, fewer than 2")]
    Dims {
        /// 0, 1 or 2.
        axis: usize,
        /// Samples along it.
        count: usize,
    },
    /// The grid would not fit.
    #[error(
        "the distance grid would have {samples} samples, more than {limit}: use a larger spacing"
    )]
    TooLarge {
        /// Samples it would have.
        samples: f64,
        /// The limit.
        limit: usize,
    },
}

/// A uniform grid of sample positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    origin: Point3<f64>,
    spacing: f64,
    dims: [usize; 3],
}

impl Lattice {
    /// `dims` samples along each axis, `spacing` \[m\] apart, the first at `origin` \[m\].
    ///
    /// # Errors
    /// [`SdfError`] for a spacing that is not positive (1e-100 m at least), samples beyond 1e100 m, fewer than two samples along an
    /// axis, or more than [`MAX_SAMPLES`] in all.
    pub fn new(origin: Point3<f64>, spacing: f64, dims: [usize; 3]) -> Result<Self, SdfError> {
        check_spacing(spacing)?;
        let within = |x: f64| x.abs() <= FARTHEST;
        let last = |axis: usize| origin[axis] + dims[axis] as f64 * spacing;
        if !(0..3).all(|axis| within(origin[axis]) && within(last(axis))) {
            return Err(SdfError::Origin);
        }
        if let Some(axis) = dims.iter().position(|&n| n < 2) {
            return Err(SdfError::Dims { axis, count: dims[axis] });
        }
        let samples = dims.iter().map(|&n| n as f64).product::<f64>();
        if samples > MAX_SAMPLES as f64 {
            return Err(SdfError::TooLarge { samples, limit: MAX_SAMPLES });
        }
        Ok(Self { origin, spacing, dims })
    }

    /// Samples every `spacing` \[m\] over `bounds` \[m\] and at least `margin` \[m\] around them, centered, so that a symmetric
    /// shape has symmetric samples.
    ///
    /// # Errors
    /// [`SdfError`] for lengths that make no sense or too many samples.
    pub fn around(
        bounds: (Point3<f64>, Point3<f64>),
        spacing: f64,
        margin: f64,
    ) -> Result<Self, SdfError> {
        check_spacing(spacing)?;
        if !(margin.is_finite() && margin >= 0.0) {
            return Err(SdfError::Length {
                name: "margin",
                value: margin,
                requirement: "finite and not negative",
            });
        }
        let size = bounds.1 - bounds.0;
        if !size.iter().all(|s| s.is_finite() && *s >= 0.0) {
            return Err(SdfError::Bounds);
        }
        let counts = size.map(|s| ((s + 2.0 * margin) / spacing).ceil().max(1.0) + 1.0);
        // A cast saturates, which the product of the checks then finds too large.
        let dims = [counts.x as usize, counts.y as usize, counts.z as usize];
        let center = nalgebra::center(&bounds.0, &bounds.1);
        Self::new(center - (counts - Vector3::repeat(1.0)) * (0.5 * spacing), spacing, dims)
    }

    /// Position of the first sample \[m\].
    pub fn origin(&self) -> Point3<f64> {
        self.origin
    }

    /// Distance between samples \[m\].
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Number of samples along each axis.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Position of a sample \[m\].
    #[inline]
    pub fn position(&self, [i, j, k]: [usize; 3]) -> Point3<f64> {
        self.origin + Vector3::new(i as f64, j as f64, k as f64) * self.spacing
    }
}

fn check_spacing(spacing: f64) -> Result<(), SdfError> {
    if spacing.is_finite() && spacing >= 1.0 / FARTHEST {
        return Ok(());
    }
    let requirement = "finite and positive, 1e-100 at least";
    Err(SdfError::Length { name: "spacing", value: spacing, requirement })
}
