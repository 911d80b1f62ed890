//! Sampling a signed distance onto a grid.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use super::SdfGrid;
use crate::ClosestPoints;

/// Largest number of samples a grid may have: half a gigabyte.
pub const MAX_SAMPLES: usize = 64 << 20;

/// Why a grid cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SdfError {
    /// A length is not usable.
    #[error("{name} of the distance grid is {value} m, but must be finite and {requirement}")]
    Length {
        /// "spacing" or "margin".
        name: &'static str,
        /// What was given \[m\].
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
    /// The box around the shape is not finite or turned around.
    #[error("the box around the shape is not finite or has a negative size")]
    Bounds,
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

impl SdfGrid {
    /// Samples the signed distance to a mesh every `spacing` \[m\], up to at least `margin` \[m\] around
    /// the mesh. Each sample is exact; rows are sampled in parallel.
    ///
    /// # Errors
    /// [`SdfError`] for lengths that make no sense or too many samples.
    pub fn build(mesh: &ClosestPoints, spacing: f64, margin: f64) -> Result<Self, SdfError> {
        Self::from_fn(mesh.bounds(), spacing, margin, |point, bound| {
            match mesh.signed_distance_within(point, bound) {
                Some((distance, _)) => distance,
                None => mesh.signed_distance(point).0,
            }
        })
    }

    /// Samples any signed distance of a shape within `bounds` \[m\].
    ///
    /// `distance` gets a point and an upper bound of the unsigned distance there (infinite where none
    /// is known): that of the neighbouring sample plus the step between them.
    ///
    /// # Errors
    /// As [`Self::build`].
    pub fn from_fn(
        bounds: (Point3<f64>, Point3<f64>),
        spacing: f64,
        margin: f64,
        distance: impl Fn(&Point3<f64>, f64) -> f64 + Sync,
    ) -> Result<Self, SdfError> {
        if !(spacing.is_finite() && spacing > 0.0) {
            return Err(SdfError::Length {
                name: "spacing",
                value: spacing,
                requirement: "positive",
            });
        }
        if !(margin.is_finite() && margin >= 0.0) {
            return Err(SdfError::Length {
                name: "margin",
                value: margin,
                requirement: "not negative",
            });
        }
        let size = bounds.1 - bounds.0;
        if !size.iter().all(|s| s.is_finite() && *s >= 0.0) {
            return Err(SdfError::Bounds);
        }
        let counts = size.map(|s| ((s + 2.0 * margin) / spacing).ceil().max(1.0) + 1.0);
        let samples = counts.product();
        if samples > MAX_SAMPLES as f64 {
            return Err(SdfError::TooLarge { samples, limit: MAX_SAMPLES });
        }
        let dims = [counts.x as usize, counts.y as usize, counts.z as usize];
        // Centred, so that a symmetric shape has symmetric samples.
        let center = nalgebra::center(&bounds.0, &bounds.1);
        let origin = center - (counts - Vector3::repeat(1.0)) * (0.5 * spacing);
        let mut values = vec![0.0; dims[0] * dims[1] * dims[2]];
        values.par_chunks_mut(dims[2]).enumerate().for_each(|(row, line)| {
            let (i, j) = (row / dims[1], row % dims[1]);
            let mut bound = f64::INFINITY;
            for (k, value) in line.iter_mut().enumerate() {
                let offset = Vector3::new(i as f64, j as f64, k as f64) * spacing;
                *value = distance(&(origin + offset), bound);
                // A distance changes by at most the length of the step; the rest is rounding.
                bound = (value.abs() + spacing) * (1.0 + 1e-9);
            }
        });
        Ok(Self::from_samples(origin, spacing, dims, &values, bounds))
    }
}
