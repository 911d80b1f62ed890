//! How far the interpolated distance is from the true one.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::SdfGrid;
use crate::ClosestPoints;

/// Errors of a grid near a surface \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SdfErrorBound {
    /// The largest seen half-way between samples; elsewhere it may be somewhat larger.
    pub measured: f64,
    /// What no point exceeds: the error half-way plus what value and spline may change from there. Certain, and loose.
    pub certain: f64,
}

impl SdfGrid {
    /// Compares the grid with the mesh it was built from, wherever the mesh is at most `reach` \[m\] away within the grid.
    ///
    /// Both are measured at the middles of cells, of their faces and of their edges. No point is farther than `√3/4`
    /// spacings from one of those or from a sample; over that length the distance changes by at most as much, and the
    /// spline by at most its greatest slope times as much, which the differences of its coefficients bound (de Boor, A
    /// practical guide to splines, 1978: derivatives are splines of the differences, within their convex hull).
    /// Takes several times as long as building the band; for a dilated grid the dilation is taken into account.
    pub fn error_bound(&self, mesh: &ClosestPoints, reach: f64) -> SdfErrorBound {
        let [nx, ny, nz] = self.dims();
        let h = self.spacing();
        let (to_corner, to_half) = (0.5 * 3.0_f64.sqrt() * h, 0.25 * 3.0_f64.sqrt() * h);
        let slab = |i: usize| {
            let (mut measured, mut certain) = (0.0_f64, 0.0_f64);
            for (j, k) in (0..ny - 1).flat_map(|j| (0..nz - 1).map(move |k| (j, k))) {
                let corner = self.lattice.position([i, j, k]);
                let middle = corner + Vector3::repeat(0.5 * h);
                if mesh.closest(&middle, reach + to_corner).is_none() {
                    continue;
                }
                // 27 points of which eight are samples; each face and edge is seen from every cell it borders.
                let mut worst = 0.0_f64;
                for n in 0..27 {
                    let at = Vector3::new((n % 3) as f64, (n / 3 % 3) as f64, (n / 9) as f64);
                    let p = corner + at * (0.5 * h);
                    let exact = mesh.signed_distance(&p).0 - self.offset;
                    worst = worst.max((self.evaluate(&p).distance - exact).abs());
                }
                measured = measured.max(worst);
                certain = certain.max(worst + (1.0 + self.lipschitz_bound([i, j, k])) * to_half);
            }
            (measured, certain)
        };
        let slabs: Vec<(f64, f64)> = (0..nx - 1).into_par_iter().map(slab).collect();
        let (measured, certain) =
            slabs.into_iter().fold((0.0_f64, 0.0_f64), |a, b| (a.0.max(b.0), a.1.max(b.1)));
        SdfErrorBound { measured, certain }
    }

    /// An upper bound of the spline's slope within a cell \[1\].
    fn lipschitz_bound(&self, cell: [usize; 3]) -> f64 {
        let [_, ny, nz] = self.dims();
        let strides = [(ny + 2) * (nz + 2), nz + 2, 1];
        let first: usize = (0..3).map(|a| cell[a] * strides[a]).sum();
        let mut slopes = Vector3::zeros();
        for n in 0..64 {
            let index = [n % 4, n / 4 % 4, n / 16];
            let at = first + (0..3).map(|a| index[a] * strides[a]).sum::<usize>();
            for a in (0..3).filter(|&a| index[a] < 3) {
                let step = (self.coefficients[at + strides[a]] - self.coefficients[at]).abs();
                slopes[a] = f64::max(slopes[a], step);
            }
        }
        slopes.norm() / self.spacing()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::SplitMix64;
    use crate::shapes::cuboid;

    #[test]
    fn no_point_exceeds_the_bound_and_finer_grids_have_smaller_ones() {
        let mesh = ClosestPoints::new(&cuboid(Vector3::new(0.04, 0.05, 0.06))).unwrap();
        let mut random = SplitMix64::new(3);
        let mut before = f64::INFINITY;
        for spacing in [0.005, 0.0025] {
            let grid = SdfGrid::build(&mesh, spacing, 0.012).unwrap().dilated(0.001).unwrap();
            let bound = grid.error_bound(&mesh, 0.006);
            let mut worst = 0.0_f64;
            for _ in 0..20_000 {
                let p = Point3::from([(); 3].map(|()| 0.08 * (random.uniform() - 0.5)));
                let exact = mesh.signed_distance(&p).0;
                if exact.abs() <= 0.006 {
                    worst = worst.max((grid.evaluate(&p).distance - exact + 0.001).abs());
                }
            }
            assert!(worst <= bound.certain && bound.measured <= bound.certain);
            // The edges of the box leave a fraction of the spacing, nearly the largest of it half-way.
            assert!(worst < 1.3 * bound.measured, "{worst} {bound:?}");
            assert!(bound.measured < 0.5 * spacing && bound.certain < 3.0 * spacing, "{bound:?}");
            assert!(bound.certain < 0.7 * before);
            before = bound.certain;
        }
    }
}
