//! Which samples of a block are inside of a mesh that is not closed.

use nalgebra::Point3;

use super::Lattice;
use crate::closest::ClosestPoints;

/// Whole planes of samples along x.
pub(super) struct SampleBlock<'a> {
    lattice: &'a Lattice,
    first: usize,
    dims: [usize; 3],
}

impl<'a> SampleBlock<'a> {
    /// `count` samples from plane `first` on.
    pub(super) fn new(lattice: &'a Lattice, first: usize, count: usize) -> Self {
        let [_, ny, nz] = lattice.dims();
        Self { lattice, first, dims: [count / (ny * nz), ny, nz] }
    }

    /// Bound of the distance of two samples beside each other, as they and distances from them are rounded \[m\].
    pub(super) fn longest_step(&self) -> f64 {
        let [first, last] = [[0; 3], self.dims.map(|n| n - 1)].map(|at| self.position(at));
        let largest = first.coords.amax().max(last.coords.amax());
        self.lattice.spacing() * (1.0 + 1e-9) + 16.0 * f64::EPSILON * largest
    }

    fn number(&self, [i, j, k]: [usize; 3]) -> usize {
        (i * self.dims[1] + j) * self.dims[2] + k
    }

    fn position(&self, [i, j, k]: [usize; 3]) -> Point3<f64> {
        self.lattice.position([self.first + i, j, k])
    }

    /// Calls `visit` with the number and position of each sample, each next to the one before.
    pub(super) fn for_each(&self, mut visit: impl FnMut(usize, &Point3<f64>)) {
        let [nx, ny, nz] = self.dims;
        for i in 0..nx {
            for line in 0..ny {
                let j = if i % 2 == 0 { line } else { ny - 1 - line };
                for step in 0..nz {
                    let k = if (i * ny + line) % 2 == 0 { step } else { nz - 1 - step };
                    visit(self.number([i, j, k]), &self.position([i, j, k]));
                }
            }
        }
    }

    /// Numbers and indices of the samples beside one.
    #[inline]
    fn neighbors(&self, [i, j, k]: [usize; 3]) -> impl Iterator<Item = (usize, [usize; 3])> {
        let [nx, ny, nz] = self.dims;
        let n = self.number([i, j, k]);
        [
            (k > 0, n.wrapping_sub(1), [i, j, k.wrapping_sub(1)]),
            (k + 1 < nz, n + 1, [i, j, k + 1]),
            (j > 0, n.wrapping_sub(nz), [i, j.wrapping_sub(1), k]),
            (j + 1 < ny, n + nz, [i, j + 1, k]),
            (i > 0, n.wrapping_sub(ny * nz), [i.wrapping_sub(1), j, k]),
            (i + 1 < nx, n + ny * nz, [i + 1, j, k]),
        ]
        .into_iter()
        .filter_map(|(exists, n, index)| exists.then_some((n, index)))
    }
}

/// Makes the samples inside of `mesh` as deep at least as their distance from it, without a sign, is \[m\].
///
/// Nothing of the mesh is between two samples whose distances are more than a step in sum: unless the side changes where there is no mesh, too, they
/// are on the same side.
pub(super) fn add_insides(
    mesh: &ClosestPoints,
    block: &SampleBlock,
    unsigned: &[f64],
    values: &mut [f64],
) {
    let step = block.longest_step();
    let mut known = vec![false; unsigned.len()];
    let mut open = Vec::new();
    let [nx, ny, nz] = block.dims;
    for seed in (0..nx * ny * nz).map(|n| [n / (ny * nz), n / nz % ny, n % nz]) {
        let n = block.number(seed);
        if known[n] || unsigned[n].is_nan() {
            continue;
        }
        let center = block.position(seed);
        let (inside, radius) = mesh.side_around(&center, 0.5 * step < unsigned[n]);
        known[n] = true;
        open.push(seed);
        while let Some(at) = open.pop() {
            let n = block.number(at);
            if inside {
                values[n] = values[n].min(-unsigned[n]);
            }
            for (to, next) in block.neighbors(at) {
                let is_next = !known[to]
                    && unsigned[n] + unsigned[to] > step
                    && (block.position(next) - center).norm_squared() < radius * radius;
                if is_next {
                    known[to] = true;
                    open.push(next);
                }
            }
        }
    }
}
