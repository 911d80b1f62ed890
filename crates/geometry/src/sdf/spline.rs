//! Cubic B-splines on a uniform grid: prefilter and closed-form basis.
//!
//! Unser, Splines: a perfect fit for signal and image processing, 1999. The ends are natural (second
//! derivative zero), which makes the coefficient there the sample itself and lets the spline be
//! continued by straight lines without losing a derivative.

use std::ops::Range;

use rayon::prelude::*;

/// Cells beyond the border from where on the value of a spline is constant: the product of three such numbers is still far from the end of the range.
const FARTHEST: f64 = 1e60;

/// Basis values and derivatives of the four coefficients around a point, with respect to the grid
/// coordinate in units of the spacing.
pub(super) struct Basis {
    /// Index of the first of the four coefficients, in the array with one coefficient added at each end.
    pub(super) first: usize,
    /// Weights of the value, first and second derivative.
    pub(super) weights: [[f64; 4]; 3],
}

impl Basis {
    /// At grid coordinate `x`, sample `i` being at `x = i`, of `samples` >= 2 along the axis. Outside
    /// 0..=samples - 1 the spline goes on as a straight line.
    #[inline(always)]
    pub(super) fn at(x: f64, samples: usize) -> Self {
        let last = (samples - 1) as f64;
        let inside = x.clamp(0.0, last);
        let first = (inside as usize).min(samples - 2);
        let t = inside - first as f64;
        let s = 1.0 - t;
        let (tt, ss) = (t * t, s * s);
        let mut value = [
            ss * s * (1.0 / 6.0),
            2.0 / 3.0 - 0.5 * tt * (1.0 + s),
            2.0 / 3.0 - 0.5 * ss * (1.0 + t),
            tt * t * (1.0 / 6.0),
        ];
        let slope = [-0.5 * ss, 0.5 * (3.0 * tt - 4.0 * t), 0.5 * (4.0 * s - 3.0 * ss), 0.5 * tt];
        let mut curvature = [s, 3.0 * t - 2.0, 3.0 * s - 2.0, t];
        let beyond = x - inside;
        if beyond != 0.0 {
            let beyond = beyond.clamp(-FARTHEST, FARTHEST);
            for i in 0..4 {
                value[i] += beyond * slope[i];
            }
            curvature = [0.0; 4];
        }
        Self { first, weights: [value, slope, curvature] }
    }
}

/// Coefficients of the spline through `samples`, an array of `dims` with the last index fastest.
///
/// The result has one more coefficient at both ends of each axis. Every axis has at least two samples.
pub(super) fn prefilter(samples: &[f64], dims: [usize; 3]) -> Vec<f64> {
    let [nx, ny, nz] = dims;
    let (sy, sz) = (ny + 2, nz + 2);
    let mut c = vec![0.0; (nx + 2) * sy * sz];
    let slab = sy * sz;
    // Along z and y within each slab of constant x.
    c[slab..(nx + 1) * slab].par_chunks_mut(slab).enumerate().for_each(|(i, out)| {
        for j in 0..ny {
            let line = &mut out[(j + 1) * sz..(j + 2) * sz];
            line[1..=nz].copy_from_slice(&samples[(i * ny + j) * nz..(i * ny + j + 1) * nz]);
        }
        solve_lines(&mut out[sz..(ny + 1) * sz], sz);
        solve(out, ny, sz, 0..sz);
    });
    // Column by column, so that a column stays in cache between its two sweeps.
    for j in 0..sy {
        solve(&mut c, nx, slab, j * sz..(j + 1) * sz);
    }
    c
}

/// As [`solve`] for every line of `length` numbers, a spare one at both of its ends.
///
/// Each line is a chain of dependent operations; eight at a time keep the processor busy.
fn solve_lines(lines: &mut [f64], length: usize) {
    let n = length - 2;
    let factor = factors(n);
    for group in lines.chunks_mut(8 * length) {
        let mut lines: [&mut [f64]; 8] = [(); 8].map(|()| &mut [][..]);
        let mut count = 0;
        for (line, part) in lines.iter_mut().zip(group.chunks_mut(length)) {
            *line = part;
            count += 1;
        }
        let lines = &mut lines[..count];
        for i in 1..n - 1 {
            for c in lines.iter_mut() {
                c[i + 1] = (6.0 * c[i + 1] - c[i]) * factor[i];
            }
        }
        for i in (1..n - 1).rev() {
            for c in lines.iter_mut() {
                c[i + 1] -= factor[i] * c[i + 2];
            }
        }
        for c in lines.iter_mut() {
            c[0] = 2.0 * c[1] - c[2];
            c[n + 1] = 2.0 * c[n] - c[n - 1];
        }
    }
}

/// Inverse pivots of the elimination.
fn factors(n: usize) -> Vec<f64> {
    let mut factor = vec![0.0; n];
    for i in 1..n - 1 {
        factor[i] = 1.0 / (4.0 - factor[i - 1]);
    }
    factor
}

/// Turns `n` samples, each a row of `width` numbers with a spare row before and after, into coefficients, in the
/// given columns.
///
/// Thomas elimination of `c[i-1] + 4 c[i] + c[i+1] = 6 f[i]` with `c = f` at both ends.
pub(super) fn solve(rows: &mut [f64], n: usize, width: usize, columns: Range<usize>) {
    let factor = factors(n);
    for i in 1..n - 1 {
        let (before, from) = rows.split_at_mut((i + 1) * width);
        let previous = &before[i * width..];
        for (c, &p) in from[columns.clone()].iter_mut().zip(&previous[columns.clone()]) {
            *c = (6.0 * *c - p) * factor[i];
        }
    }
    for i in (1..n - 1).rev() {
        let (before, after) = rows.split_at_mut((i + 2) * width);
        let own = &mut before[(i + 1) * width..];
        for (c, &next) in own[columns.clone()].iter_mut().zip(&after[columns.clone()]) {
            *c -= factor[i] * next;
        }
    }
    for k in columns {
        rows[k] = 2.0 * rows[width + k] - rows[2 * width + k];
        rows[(n + 1) * width + k] = 2.0 * rows[n * width + k] - rows[(n - 1) * width + k];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_a_partition_of_unity_with_matching_derivatives() {
        let step = 1e-5;
        for x in [-0.7, 0.3, 1.0, 1.999, 2.5, 4.0, 4.6] {
            let at = |x: f64| Basis::at(x, 5);
            let b = at(x);
            assert!((b.weights[0].iter().sum::<f64>() - 1.0).abs() < 1e-14);
            assert!(b.weights[1].iter().sum::<f64>().abs() < 1e-14);
            // A spline of arbitrary coefficients, natural at the ends, differentiated numerically.
            let mut c = [0.0, 2.0, -1.0, 0.5, 3.0, 1.0, 0.0];
            (c[0], c[6]) = (2.0 * c[1] - c[2], 2.0 * c[5] - c[4]);
            let eval = |x: f64, d: usize| {
                let b = at(x);
                (0..4).map(|i| c[b.first + i] * b.weights[d][i]).sum::<f64>()
            };
            for d in 0..2 {
                let difference = (eval(x + step, d) - eval(x - step, d)) / (2.0 * step);
                assert!(
                    (difference - eval(x, d + 1)).abs() < 2e-4 * step.sqrt() + 4.0 * step,
                    "{x} {d}"
                );
            }
        }
    }

    #[test]
    fn the_spline_passes_through_every_sample() {
        let dims = [4, 2, 7];
        let samples: Vec<f64> = (0..56).map(|i| ((i * i) as f64 * 0.7).sin()).collect();
        let c = prefilter(&samples, dims);
        for i in 0..4 {
            for j in 0..2 {
                for k in 0..7 {
                    let b =
                        [Basis::at(i as f64, 4), Basis::at(j as f64, 2), Basis::at(k as f64, 7)];
                    let mut value = 0.0;
                    for p in 0..64 {
                        let o = [p / 16, p / 4 % 4, p % 4];
                        let index =
                            ((b[0].first + o[0]) * 4 + b[1].first + o[1]) * 9 + b[2].first + o[2];
                        value += c[index] * (0..3).map(|a| b[a].weights[0][o[a]]).product::<f64>();
                    }
                    assert!((value - samples[(i * 2 + j) * 7 + k]).abs() < 1e-14);
                }
            }
        }
    }
}
