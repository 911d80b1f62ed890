//! Sampling a signed distance onto a grid.

use nalgebra::Point3;
use rayon::prelude::*;

use super::sides::{SampleBlock, add_insides};
use super::{Lattice, SdfError, SdfGrid};
use crate::closest::{ClosestPoints, box_distance};

/// Planes of samples along x that one task measures where insides spread from sample to sample.
const PLANES: usize = 16;

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
        Self::of_union(std::slice::from_ref(mesh), mesh.bounds(), lattice)
    }

    /// Samples the smallest signed distance to any of several meshes within `bounds` \[m\].
    pub(crate) fn of_union(
        meshes: &[ClosestPoints],
        bounds: (Point3<f64>, Point3<f64>),
        lattice: Lattice,
    ) -> Self {
        let [_, ny, nz] = lattice.dims();
        let planes = if meshes.iter().all(ClosestPoints::is_closed) { 1 } else { PLANES };
        let mut values = vec![0.0; lattice.dims().iter().product()];
        values.par_chunks_mut(planes * ny * nz).enumerate().for_each(|(block, values)| {
            sample(meshes, &SampleBlock::new(&lattice, block * planes, values.len()), values);
        });
        Self::from_samples(lattice, &values, bounds)
    }
}

/// A mesh of a union, and what was found at the last samples.
struct UnionPart<'a> {
    mesh: &'a ClosestPoints,
    /// Face of the last answer.
    face: Option<u32>,
    /// Distances \[m\], without signs, of a mesh whose insides are to be found from all of them; NaN where others are nearer.
    unsigned: Vec<f64>,
}

/// The smallest signed distance to any of the meshes at the samples of a block.
fn sample(meshes: &[ClosestPoints], block: &SampleBlock, values: &mut [f64]) {
    let mut parts = Vec::with_capacity(meshes.len());
    for mesh in meshes {
        let count = if mesh.is_closed() { 0 } else { values.len() };
        parts.push(UnionPart { mesh, face: None, unsigned: vec![f64::NAN; count] });
    }
    // What is nearest may be outside of one and inside of another, unknown yet.
    let is_bounded = meshes.len() == 1 || meshes.iter().all(ClosestPoints::is_closed);
    let mut bound = f64::INFINITY;
    block.for_each(|n, point| {
        let value = parts.iter_mut().fold(f64::INFINITY, |best: f64, part| {
            let gap = box_distance(&part.mesh.bounds(), point);
            // Outside its box a mesh matters only if nearer than the best; inside it may also be deeper.
            let limit = if gap > 0.0 { best.max(0.0).min(bound) } else { bound };
            if gap > limit {
                return best;
            }
            let Some(closest) = part.mesh.search(point, limit, part.face) else { return best };
            part.face = Some(closest.face);
            match part.unsigned.get_mut(n) {
                Some(unsigned) => {
                    *unsigned = closest.distance;
                    best.min(closest.distance)
                }
                None => best.min(part.mesh.signed(point, Some(closest)).0),
            }
        });
        values[n] = value;
        if is_bounded {
            // A distance changes by at most the length of the step; the rest is rounding.
            bound = value.abs() * (1.0 + 1e-9) + block.longest_step();
        }
    });
    for part in parts.iter().filter(|part| !part.unsigned.is_empty()) {
        add_insides(part.mesh, block, &part.unsigned, values);
    }
}
