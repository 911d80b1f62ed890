//! Sampling a signed distance onto a grid.

use nalgebra::Point3;
use rayon::prelude::*;

use super::{Lattice, SdfError, SdfGrid};
use crate::closest::{ClosestPoints, SignMethod};

/// Samples along the side of the blocks that a narrow band is looked for in.
const BLOCK: usize = 4;

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
        Self::from_samples(lattice, &values, mesh.bounds(), f64::INFINITY)
    }

    /// Samples the signed distance to a mesh where it is at most `band` \[m\] in absolute value, at a fraction of the
    /// time; samples farther away are set to plus or minus `band`, by the right sign.
    ///
    /// The spline runs through every sample, but feels the cut in its derivatives: within two spacings of the band's edge
    /// they are off. Ask for a band two spacings wider than distances will be asked for.
    ///
    /// # Errors
    /// [`SdfError::Length`] for a band narrower than the spacing.
    pub fn build_band_on(
        mesh: &ClosestPoints,
        lattice: Lattice,
        band: f64,
    ) -> Result<Self, SdfError> {
        if !(band >= lattice.spacing() && band.is_finite()) {
            return Err(SdfError::Length {
                name: "band",
                value: band,
                requirement: "finite and at least the spacing",
            });
        }
        let [nx, ny, nz] = lattice.dims();
        let mut values = vec![f64::NAN; nx * ny * nz];
        values.par_chunks_mut(BLOCK * ny * nz).enumerate().for_each(|(slabs, values)| {
            sample_band(mesh, &lattice, band, slabs * BLOCK, values);
        });
        fill_outside(mesh, &lattice, band, &mut values);
        Ok(Self::from_samples(lattice, &values, mesh.bounds(), band))
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
        Ok(Self::from_samples(lattice, &values, bounds, f64::INFINITY))
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

/// How much wider than asked for the band is searched, so that rounding decides nothing: a sample that is not found is then
/// farther away than its neighbors from it, and on their side of the surface.
const ROUNDING: f64 = 1.0 + 1e-9;

/// Samples within the band, the first along x being number `first`; the rest is left alone.
///
/// One query at the middle of a block of samples says whether the block reaches into the band, which samples
/// certainly do not, and where to begin.
fn sample_band(
    mesh: &ClosestPoints,
    lattice: &Lattice,
    band: f64,
    first: usize,
    values: &mut [f64],
) {
    let [_, ny, nz] = lattice.dims();
    let layers = values.len() / (ny * nz);
    let radius = 0.5 * (BLOCK - 1) as f64 * lattice.spacing() * 3.0_f64.sqrt();
    let mut block_hint = None;
    for j0 in (0..ny).step_by(BLOCK) {
        for k0 in (0..nz).step_by(BLOCK) {
            let near = lattice.position([first, j0, k0]);
            let size = [layers - 1, (ny - j0).min(BLOCK) - 1, (nz - k0).min(BLOCK) - 1];
            let middle = nalgebra::center(
                &near,
                &lattice.position([first + size[0], j0 + size[1], k0 + size[2]]),
            );
            let Some(block) = mesh.search(&middle, (band + radius) * ROUNDING, block_hint) else {
                continue;
            };
            block_hint = Some(block.face);
            let certain = (block.distance - band * ROUNDING).max(0.0);
            let certain_squared = certain * certain;
            let mut last_sample = (middle, block);
            for i in 0..=size[0] {
                for j in 0..=size[1] {
                    // To and fro, so that each sample is next to the one before.
                    let j = j0 + if i % 2 == 0 { j } else { size[1] - j };
                    for k in 0..=size[2] {
                        let k = k0 + if (i + j) % 2 == 0 { k } else { size[2] - k };
                        let p = lattice.position([first + i, j, k]);
                        if (p - middle).norm_squared() < certain_squared {
                            continue;
                        }
                        // A distance changes by no more than its point moves.
                        let (from, last) = &last_sample;
                        let most = band.min(last.distance + (p - from).norm()) * ROUNDING;
                        if let Some(closest) = mesh.search(&p, most, Some(last.face)) {
                            last_sample = (p, closest);
                            let signed = mesh.signed(&p, Some(closest)).0;
                            values[(i * ny + j) * nz + k] = signed.clamp(-band, band);
                        }
                    }
                }
            }
        }
    }
}

/// Gives the samples outside of the band its width and their sign.
///
/// Such a sample is farther from the surface than its neighbors from it, so that on a closed surface no crossing
/// lies between: the sign is theirs. Where the surface may be open it is asked for.
fn fill_outside(mesh: &ClosestPoints, lattice: &Lattice, band: f64, values: &mut [f64]) {
    let [nx, ny, nz] = lattice.dims();
    let ask = |index: [usize; 3]| {
        let signed = mesh.signed_distance(&lattice.position(index)).0;
        band.copysign(signed)
    };
    if mesh.sign_method() == SignMethod::WindingNumber {
        values.par_chunks_mut(nz).enumerate().for_each(|(row, line)| {
            for (k, value) in line.iter_mut().enumerate().filter(|(_, v)| v.is_nan()) {
                *value = ask([row / ny, row % ny, k]);
            }
        });
        return;
    }
    for i in 0..nx {
        let corner = i * ny * nz;
        if values[corner].is_nan() {
            values[corner] =
                if i == 0 { ask([0; 3]) } else { band.copysign(values[corner - ny * nz]) };
        }
    }
    values.par_chunks_mut(ny * nz).for_each(|slab| {
        for j in 0..ny {
            if slab[j * nz].is_nan() {
                slab[j * nz] = band.copysign(slab[(j - 1) * nz]);
            }
            let line = &mut slab[j * nz..(j + 1) * nz];
            let mut previous = line[0];
            for value in line {
                if value.is_nan() {
                    *value = band.copysign(previous);
                }
                previous = *value;
            }
        }
    });
}
