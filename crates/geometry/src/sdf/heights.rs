//! Heights on a rectangular grid, interpolated with continuous second derivatives.

use super::spline::{Basis, solve};

/// A height over a plane: a bicubic B-spline through heights on a rectangular grid, twice continuously differentiable everywhere.
///
/// Beyond its border it goes on by straight lines.
#[derive(Clone, Debug)]
pub struct HeightSpline {
    origin: [f64; 2],
    spacing: [f64; 2],
    dims: [usize; 2],
    coefficients: Vec<f64>,
}

/// A height \[m\] with its slopes \[1\] and second derivatives by uu, uv, vv \[1/m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightSample {
    /// The height \[m\].
    pub height: f64,
    /// Its derivatives by u and v.
    pub slopes: [f64; 2],
    /// Its second derivatives by uu, uv, vv \[1/m\].
    pub curvatures: [f64; 3],
}

impl HeightSpline {
    /// Through `heights` \[m\], as many as the product of `dims`, those along v next to each other: the first at `origin` \[m\], the
    /// others `spacing` \[m\] apart along u and v.
    ///
    /// None if numbers are not finite, spacings not positive, fewer than two along an axis or not as many as `dims` says.
    pub fn new(
        heights: &[f64],
        dims: [usize; 2],
        origin: [f64; 2],
        spacing: [f64; 2],
    ) -> Option<Self> {
        let [nu, nv] = dims;
        let fine = heights.iter().chain(&origin).chain(&spacing).all(|x| x.is_finite())
            && spacing.iter().all(|x| *x > 0.0)
            && dims.iter().all(|n| *n >= 2)
            && nu.checked_mul(nv) == Some(heights.len());
        if !fine {
            return None;
        }
        let width = nv + 2;
        let mut coefficients = vec![0.0; (nu + 2) * width];
        for (row, heights) in coefficients[width..].chunks_mut(width).zip(heights.chunks(nv)) {
            row[1..=nv].copy_from_slice(heights);
            solve(row, nv, 1, 0..1);
        }
        solve(&mut coefficients, nu, width, 0..width);
        Some(Self { origin, spacing, dims, coefficients })
    }

    /// The height at (u, v) \[m\] with its derivatives.
    #[inline]
    pub fn at(&self, u: f64, v: f64) -> HeightSample {
        let [bu, bv] = self.bases([u, v]);
        let mut sums = [[0.0; 3]; 3];
        for i in 0..4 {
            let row = self.row(&bu, &bv, i);
            for (along_v, weights) in bv.weights.iter().enumerate() {
                let line: f64 = (0..4).map(|k| weights[k] * row[k]).sum();
                for (sums, weights) in sums.iter_mut().zip(&bu.weights) {
                    sums[along_v] += weights[i] * line;
                }
            }
        }
        let [a, b] = self.spacing.map(|spacing| 1.0 / spacing);
        HeightSample {
            height: sums[0][0],
            slopes: [sums[1][0] * a, sums[0][1] * b],
            curvatures: [sums[2][0] * a * a, sums[1][1] * a * b, sums[0][2] * b * b],
        }
    }

    /// No height rises faster than this along any direction \[1\].
    pub fn steepest(&self) -> f64 {
        let width = self.dims[1] + 2;
        let rise = |step: usize, spacing: f64, inner: &dyn Fn(usize) -> bool| {
            let pairs = self.coefficients.iter().zip(&self.coefficients[step..]).enumerate();
            let rises = pairs.filter(|(i, _)| inner(*i)).map(|(_, (a, b))| (b - a).abs());
            rises.fold(0.0, f64::max) / spacing
        };
        let along_u = rise(width, self.spacing[0], &|_| true);
        let along_v = rise(1, self.spacing[1], &|i| i % width + 1 < width);
        along_u.hypot(along_v)
    }

    // Written out, for the functions of arrays are not inlined.
    #[inline(always)]
    fn bases(&self, [u, v]: [f64; 2]) -> [Basis; 2] {
        [
            Basis::at((u - self.origin[0]) / self.spacing[0], self.dims[0]),
            Basis::at((v - self.origin[1]) / self.spacing[1], self.dims[1]),
        ]
    }

    /// Distance of heights along u and v \[m\].
    pub fn spacing(&self) -> [f64; 2] {
        self.spacing
    }

    #[inline]
    fn row(&self, bu: &Basis, bv: &Basis, i: usize) -> &[f64] {
        let start = (bu.first + i) * (self.dims[1] + 2) + bv.first;
        &self.coefficients[start..start + 4]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_through_heights_and_matches_differences() {
        let (dims, origin, spacing) = ([5, 7], [-0.3, 0.2], [0.1, 0.25]);
        let heights: Vec<f64> = (0..35).map(|i| (f64::from(i * i) * 0.7).sin()).collect();
        let spline = HeightSpline::new(&heights, dims, origin, spacing).unwrap();
        for (i, height) in heights.iter().enumerate() {
            let place = [i / 7, i % 7];
            let [u, v] = [0, 1].map(|k| origin[k] + place[k] as f64 * spacing[k]);
            assert!((spline.at(u, v).height - height).abs() < 1e-13);
        }
        let step = 1e-6;
        for [u, v] in [[-0.17, 0.9], [0.05, 1.41], [-0.5, 0.3], [0.013, 3.0]] {
            let at = spline.at(u, v);
            let by = |du: f64, dv: f64| {
                let [a, b] = [1.0, -1.0].map(|sign| spline.at(u + sign * du, v + sign * dv));
                let slope = |x: f64, y: f64| (x - y) / (2.0 * step);
                [
                    slope(a.height, b.height),
                    slope(a.slopes[0], b.slopes[0]),
                    slope(a.slopes[1], b.slopes[1]),
                ]
            };
            let (by_u, by_v) = (by(step, 0.0), by(0.0, step));
            let off = [
                by_u[0] - at.slopes[0],
                by_v[0] - at.slopes[1],
                by_u[1] - at.curvatures[0],
                by_u[2] - at.curvatures[1],
                by_v[1] - at.curvatures[1],
                by_v[2] - at.curvatures[2],
            ];
            assert!(off.iter().all(|x| x.abs() < 1e-6), "{off:?}");
            assert!(at.slopes[0].hypot(at.slopes[1]) <= spline.steepest());
        }
        assert!(HeightSpline::new(&heights, [5, 6], origin, spacing).is_none());
        assert!(HeightSpline::new(&heights, dims, origin, [0.1, 0.0]).is_none());
    }
}
