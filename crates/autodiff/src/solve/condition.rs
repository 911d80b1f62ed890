//! How much of a solution rounding leaves.

use nalgebra::DMatrix;

use super::factors::Factors;

/// Beyond this condition number a solution has at most about three digits, and a singular matrix cannot
/// be told from a regular one: its factors hold rounding errors only.
pub(super) const LARGEST: f64 = 1e13;

/// Directions probed.
const PROBES: usize = 3;

/// A condition number that better scales would not bring down to a more comfortable one.
const GOOD: f64 = 1e6;

/// Most solves for one estimate.
const ROUNDS: usize = 8;

/// Condition number ‖S⁻¹ |A⁻¹| |A| S‖∞, estimated from below to about an order of magnitude, in most cases
/// at the cost of one solve; infinite when A is singular.
///
/// Without the scales S of the unknowns this is the condition number of R. D. Skeel, "Scaling for numerical
/// stability in Gaussian elimination", J. ACM 26, 1979, which does not depend on the units of the
/// equations. S takes out those of the unknowns: it first balances the columns of |A|, and if that leaves
/// the condition number large, follows the power iteration to the S for which it is smallest (F. L. Bauer,
/// "Optimally scaled matrices", Numer. Math. 5, 1963). Random directions stand in for |A⁻¹|, as in
/// C. S. Kenney, A. J. Laub, "Small-sample statistical condition estimates for general matrix functions",
/// SIAM J. Sci. Comput. 15, 1994.
pub(super) fn estimate(
    size: usize,
    entries: impl Iterator<Item = (usize, usize, f64)> + Clone,
    factors: &dyn Factors,
) -> f64 {
    let mut scales = column_scales(size, entries.clone());
    let mut smallest = f64::INFINITY;
    for _ in 0..ROUNDS {
        let mut row_sums = vec![0.0; size];
        for (row, column, value) in entries.clone() {
            row_sums[row] += value.abs() * scales[column];
        }
        let mut probes =
            DMatrix::from_fn(size, PROBES, |row, probe| row_sums[row] * direction(row, probe));
        factors.solve(&mut probes);
        if !probes.iter().all(|x| x.is_finite()) {
            return f64::INFINITY;
        }
        let grown: Vec<f64> = probes.row_iter().map(|row| row.amax()).collect();
        let growth = grown.iter().zip(&scales).fold(1.0, |max: f64, (x, s)| max.max(x / s));
        let improves = growth < 0.5 * smallest;
        smallest = smallest.min(growth);
        if smallest <= GOOD || !improves {
            break;
        }
        let unit = grown.iter().copied().fold(0.0, f64::max);
        scales = grown.iter().map(|x| x / unit).collect();
    }
    smallest
}

/// Factors that make the columns of |A| sum to 1, once its rows do.
fn column_scales(
    size: usize,
    entries: impl Iterator<Item = (usize, usize, f64)> + Clone,
) -> Vec<f64> {
    let reciprocals = |sums: Vec<f64>| sums.into_iter().map(f64::recip).collect::<Vec<f64>>();
    let mut rows = vec![0.0; size];
    entries.clone().for_each(|(row, _, value)| rows[row] += value.abs());
    let rows = reciprocals(rows);
    let mut columns = vec![0.0; size];
    entries.for_each(|(row, column, value)| columns[column] += value.abs() * rows[row]);
    reciprocals(columns)
}

/// A number in (−1, 1) that looks random: the same for the same place, and without a pattern that the
/// null vector of a regular grid could share (splitmix64).
fn direction(row: usize, probe: usize) -> f64 {
    let mut z = ((row * PROBES + probe) as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    (z >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

#[cfg(test)]
mod tests {
    use nalgebra::{DVector, Matrix2, Matrix3, Vector2};

    use super::*;
    use crate::solve::{SolveError, lu};

    fn hilbert(size: usize) -> DMatrix<f64> {
        DMatrix::from_fn(size, size, |i, j| 1.0 / (i + j + 1) as f64)
    }

    #[test]
    fn units_do_not_count() {
        let scaled = Matrix3::from_diagonal(&[1e-150, 1.0, 1e150].into());
        assert!(lu(&scaled).unwrap().condition < 2.0);
        let a = Matrix3::new(2.0, 1.0, 0.0, -1.0, 3.0, 1.0, 0.0, 1.0, 2.0);
        assert!(lu(&a).unwrap().condition < 10.0);
        for rows in [[1e-9, 1.0, 1.0], [1.0, 1e30, 1e-30], [1e100, 1.0, 1e-20]] {
            for columns in [[1.0, 1.0, 1e12], [1e-20, 1.0, 1e10], [1.0, 1e40, 1e-40]] {
                let [rows, columns] = [rows, columns].map(|s| Matrix3::from_diagonal(&s.into()));
                let condition = lu(&(rows * a * columns)).unwrap().condition;
                assert!(condition < 1e3, "{rows} {columns} {condition}");
            }
        }
    }

    #[test]
    fn the_estimate_is_of_the_size_of_the_condition_number() {
        for size in [1, 2, 3, 4, 5, 6, 7, 8] {
            let a = hilbert(size);
            let entries = (0..size * size).map(|k| (k % size, k / size, a[k]));
            let scales = DVector::from_vec(column_scales(size, entries));
            let scaled = &a * DMatrix::from_diagonal(&scales);
            let product = scaled.clone().try_inverse().unwrap().abs() * scaled.abs();
            let exact = product.row_iter().map(|row| row.sum()).fold(0.0, f64::max);
            let estimate = lu(&a).unwrap().condition;
            assert!(estimate <= exact * (1.0 + 1e-6), "{size}: {estimate:e} {exact:e}");
            assert!(estimate >= 0.05 * exact, "{size}: {estimate:e} {exact:e}");
        }
    }

    #[test]
    fn singular_matrices_whose_pivots_are_rounding_errors_are_refused() {
        let rank_two = Matrix3::new(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9);
        let refused = lu(&rank_two).unwrap_err();
        assert!(matches!(refused, SolveError::Singular { condition } if condition > 1e13));
        assert!(lu(&hilbert(13)).is_err());
        // A free chain of springs, whose null vector is constant.
        let free = |size: usize| {
            DMatrix::from_fn(size, size, |i, j| match i.abs_diff(j) {
                0 if i == 0 || i + 1 == size => 0.1,
                0 => 0.2,
                1 => -0.1,
                _ => 0.0,
            })
        };
        // Seen in other coordinates, so that no pivot comes out as an exact zero.
        let turn = |size: usize| {
            let v = DVector::from_fn(size, |i, _| (i as f64 + 0.3).sin()).normalize();
            DMatrix::identity(size, size) - &v * v.transpose() * 2.0
        };
        for size in [2, 3, 10, 50, 150] {
            assert!(lu(&(turn(size) * free(size) * turn(size))).is_err(), "{size}");
        }
    }

    #[test]
    fn nearly_singular_matrices_are_solved() {
        for gap in [1e-4, 1e-8, 1e-11] {
            let a = Matrix2::new(1.0, 1.0, 1.0, 1.0 + gap);
            let factored = lu(&a).unwrap();
            assert!(factored.condition > 0.1 / gap, "{}", factored.condition);
            let x = factored.solve(&Vector2::new(2.0, 2.0 + gap)).unwrap();
            assert!((x - Vector2::repeat(1.0)).amax() < 1e-15 / gap, "{x}");
        }
        let refused = lu(&Matrix2::new(1.0, 1.0, 1.0, 1.0 + 1e-15)).unwrap_err();
        assert!(matches!(refused, SolveError::Singular { condition } if condition.is_finite()));
    }
}
