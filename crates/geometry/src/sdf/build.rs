//! Sampling a signed distance onto a grid.

use nalgebra::Point3;
use rayon::prelude::*;

use super::{Lattice, SdfError, SdfGrid};
use crate::closest::ClosestPoints;

impl SdfGrid {
    /// Samples the signed distance to a mesh every `spacing` \[m\], up to at least `margin` \[m\] around
    /// the mesh. Each sample is exact.
    ///
    /// # Errors
    /// [`SdfError`] for lengths that make no sense or too many samples.
    pub fn build(mesh: &ClosestPoints, spacing: f64, margin: f64) -> Result<Self, SdfError> {
        Ok(Self::build_on(mesh, Lattice::around(mesh.bounds(), spacing, margin)?))
    }

    /// As [`Self::build`], with the samples of a given lattice.
    pub fn build_on(mesh: &ClosestPoints, lattice: Lattice) -> Self {
        let [_, ny, nz] = lattice.dims();
        let mut values = vec![0.0; lattice.dims().iter().product()];
        values.par_chunks_mut(ny * nz).enumerate().for_each(|(i, slab)| {
            sample_slab(mesh, &lattice, i, slab);
        });
        Self::from_samples(lattice, &values, mesh.bounds())
    }

    /// Samples any signed distance of a shape within `bounds` \[m\].
    ///
    /// `start` begins a walk from sample to sample, of which there are several at once. It gets a point and an upper bound of the unsigned
    /// distance there (infinite where none is known): that of the sample before plus the step between them.
    ///
    /// # Errors
    /// As [`Self::build`].
    pub fn from_fn<D: FnMut(&Point3<f64>, f64) -> f64>(
        bounds: (Point3<f64>, Point3<f64>),
        spacing: f64,
        margin: f64,
        start: impl Fn() -> D + Sync,
    ) -> Result<Self, SdfError> {
        let lattice = Lattice::around(bounds, spacing, margin)?;
        let [_, ny, nz] = lattice.dims();
        let mut values = vec![0.0; lattice.dims().iter().product()];
        values.par_chunks_mut(ny * nz).enumerate().for_each(|(i, slab)| {
            let (mut distance, mut bound) = (start(), f64::INFINITY);
            for (j, line) in slab.chunks_mut(nz).enumerate() {
                for step in 0..nz {
                    // To and fro, so that each sample is next to the one before.
                    let k = if j % 2 == 0 { step } else { nz - 1 - step };
                    line[k] = distance(&lattice.position([i, j, k]), bound);
                    // A distance changes by at most the length of the step; the rest is rounding.
                    bound = (line[k].abs() + spacing) * (1.0 + 1e-9);
                }
            }
        });
        Ok(Self::from_samples(lattice, &values, bounds))
    }
}

/// Samples `i` along x; each search starts from the answer of a neighbor.
fn sample_slab(mesh: &ClosestPoints, lattice: &Lattice, i: usize, slab: &mut [f64]) {
    let nz = lattice.dims()[2];
    let mut row_hint = None;
    for (j, line) in slab.chunks_mut(nz).enumerate() {
        let mut hint = row_hint;
        for (k, value) in line.iter_mut().enumerate() {
            let (signed, face) = mesh.signed_distance_hinted(&lattice.position([i, j, k]), hint);
            *value = signed;
            hint = Some(face);
            if k == 0 {
                row_hint = hint;
            }
        }
    }
}
