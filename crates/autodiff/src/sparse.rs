//! Sparse Jacobians at the price of a few directional derivatives, by coloring.
//!
//! Columns that share no row can be differentiated together: what each row then holds is the derivative by the
//! only one of them that it depends on. So [`Forward`] finds a tridiagonal Jacobian of any size
//! from three directions, which fit in one evaluation:
//!
//! ```
//! use prehend_autodiff::Scalar;
//! use prehend_autodiff::sparse::{Forward, Pattern};
//!
//! /// Springs in a row: the force on each of the masses.
//! fn forces<S: Scalar>(x: &[S]) -> Vec<S> {
//!     let pull = |a: S, b: S| (b - a) * (b - a) * (b - a);
//!     let wall = S::zero();
//!     (0..x.len())
//!         .map(|i| {
//!             let left = if i == 0 { wall } else { x[i - 1] };
//!             let right = x.get(i + 1).copied().unwrap_or(wall);
//!             pull(x[i], right) - pull(left, x[i])
//!         })
//!         .collect()
//! }
//!
//! let x = [0.1; 1000];
//! let jacobian = Forward::new(Pattern::detect(forces, &x));
//! assert_eq!(jacobian.colors(), 3);
//! let (values, entries) = jacobian.evaluate(forces, &x)?;
//! assert_eq!((values.len(), entries.len()), (1000, 2998));
//! # Ok::<(), prehend_autodiff::sparse::SparseError>(())
//! ```
//!
//! [`Reverse`] does the same with rows: it is the one for matrices with a dense row. Both need many colors where
//! a row and a column are dense. The entries come in the order of the [`Pattern`], which is that of CSR matrices.

mod coloring;
mod error;
mod pattern;

pub use error::SparseError;
pub use pattern::{LANES, Pattern};

use crate::fwd::Fwd;
use crate::recording::Recording;
use crate::var::Var;
use coloring::Coloring;

/// Jacobians of one pattern by forward mode, [`LANES`] colors of columns an evaluation.
///
/// The pattern is colored once, greedily from the columns with the most neighbors (T. F. Coleman, J. J. Moré,
/// SIAM J. Numer. Anal. 20 (1983)). There are at least as many colors as entries in the longest row.
pub struct Forward {
    pattern: Pattern,
    columns: Coloring,
}

impl Forward {
    /// Colors the columns of `pattern`.
    pub fn new(pattern: Pattern) -> Self {
        let columns = Coloring::new(&pattern.transposed(), &pattern);
        Self { pattern, columns }
    }

    /// The pattern.
    pub fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// Directional derivatives needed.
    pub fn colors(&self) -> usize {
        self.columns.count
    }

    /// Values of `f` at `x` and the entries of its Jacobian, in the order of the pattern.
    ///
    /// # Errors
    /// [`SparseError::InputCount`] or [`SparseError::OutputCount`] if sizes do not match the pattern's, and
    /// [`SparseError::RowOutsidePattern`] if an entry outside the pattern was noticed. It goes unnoticed, and
    /// is added to another, where its column has the color of one in the row's pattern.
    pub fn evaluate(
        &self,
        f: impl Fn(&[Fwd<LANES>]) -> Vec<Fwd<LANES>>,
        x: &[f64],
    ) -> Result<(Vec<f64>, Vec<f64>), SparseError> {
        check_inputs(&self.pattern, x)?;
        let mut values = Vec::new();
        let mut entries = vec![0.0; self.pattern.column_indices().len()];
        let mut inputs = vec![Fwd::from(0.0); x.len()];
        for first in (0..self.columns.count.max(1)).step_by(LANES) {
            let lane = |column: usize| {
                self.columns.of_line[column].checked_sub(first).filter(|lane| *lane < LANES)
            };
            for (column, (input, &value)) in inputs.iter_mut().zip(x).enumerate() {
                *input = lane(column).map_or(value.into(), |lane| Fwd::variable(value, lane));
            }
            let outputs = f(&inputs);
            check_outputs(&self.pattern, outputs.len())?;
            for (row, output) in outputs.iter().enumerate() {
                let mut left = output.derivative;
                let start = self.pattern.row_starts()[row];
                for (entry, &column) in entries[start..].iter_mut().zip(self.pattern.row(row)) {
                    if let Some(lane) = lane(column) {
                        *entry = std::mem::take(&mut left[lane]);
                    }
                }
                if left.iter().any(|d| *d != 0.0) {
                    return Err(SparseError::RowOutsidePattern { row });
                }
            }
            if first == 0 {
                values.extend(outputs.iter().map(|output| output.value));
            }
        }
        Ok((values, entries))
    }
}

/// Jacobians of one pattern by reverse mode: one recording, and a sweep for each color of rows.
///
/// The pattern is colored as by [`Forward`], with rows for columns.
pub struct Reverse {
    pattern: Pattern,
    /// Rows of each color.
    groups: Vec<Vec<usize>>,
}

impl Reverse {
    /// Colors the rows of `pattern`.
    pub fn new(pattern: Pattern) -> Self {
        let rows = Coloring::new(&pattern, &pattern.transposed());
        let mut groups = vec![Vec::new(); rows.count];
        rows.of_line.iter().enumerate().for_each(|(row, &color)| groups[color].push(row));
        Self { pattern, groups }
    }

    /// The pattern.
    pub fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// Sweeps needed.
    pub fn colors(&self) -> usize {
        self.groups.len()
    }

    /// Values of `f` at `x` and the entries of its Jacobian, in the order of the pattern.
    ///
    /// # Errors
    /// [`SparseError::InputCount`] or [`SparseError::OutputCount`] if sizes do not match the pattern's, and
    /// [`SparseError::ColumnOutsidePattern`] if an entry outside the pattern was noticed. It goes unnoticed, and
    /// is added to another, where its row has the color of one in the column's pattern.
    pub fn evaluate(
        &self,
        f: impl FnOnce(&[Var]) -> Vec<Var>,
        x: &[f64],
    ) -> Result<(Vec<f64>, Vec<f64>), SparseError> {
        check_inputs(&self.pattern, x)?;
        let recording = Recording::start();
        let inputs = recording.variables_of(x);
        let outputs = f(&inputs);
        check_outputs(&self.pattern, outputs.len())?;
        let mut entries = vec![0.0; self.pattern.column_indices().len()];
        for group in &self.groups {
            let seeds: Vec<(Var, f64)> = group.iter().map(|&row| (outputs[row], 1.0)).collect();
            let adjoints = recording.vjp(&seeds);
            let mut left: Vec<f64> = inputs.iter().map(|&input| adjoints.wrt(input)).collect();
            for &row in group {
                let start = self.pattern.row_starts()[row];
                for (entry, &column) in entries[start..].iter_mut().zip(self.pattern.row(row)) {
                    *entry = std::mem::take(&mut left[column]);
                }
            }
            if let Some(column) = left.iter().position(|d| *d != 0.0) {
                return Err(SparseError::ColumnOutsidePattern { column });
            }
        }
        Ok((outputs.iter().map(|output| output.value()).collect(), entries))
    }
}

fn check_inputs(pattern: &Pattern, x: &[f64]) -> Result<(), SparseError> {
    let (expected, found) = (pattern.columns(), x.len());
    if expected == found { Ok(()) } else { Err(SparseError::InputCount { expected, found }) }
}

fn check_outputs(pattern: &Pattern, found: usize) -> Result<(), SparseError> {
    let expected = pattern.rows();
    if expected == found { Ok(()) } else { Err(SparseError::OutputCount { expected, found }) }
}

#[cfg(test)]
mod tests {

    use super::*;
    use crate::scalar::Scalar;

    const N: usize = 40;

    /// A function whose row `i` depends on the columns `depends[i]`, unevenly and not linearly.
    fn tangled<S: Scalar>(depends: &[Vec<usize>], x: &[S]) -> Vec<S> {
        let term = |i: usize, j: usize| {
            let weight = S::constant(1.0 + i as f64 + 0.3 * j as f64);
            (x[j] * weight).sin() * x[j] + x[j].exp()
        };
        depends
            .iter()
            .enumerate()
            .map(|(i, row)| {
                let sum = row.iter().fold(S::constant(0.5), |sum, &j| sum + term(i, j));
                sum * sum
            })
            .collect()
    }

    fn point() -> [f64; N] {
        std::array::from_fn(|i| (i as f64 * 1.7).sin())
    }

    /// Asserts that both sides equal the dense forward Jacobian, with the pattern given and as detected.
    fn assert_like_dense(depends: &[Vec<usize>]) -> [usize; 2] {
        let x = point();
        let dense = tangled(depends, &Fwd::<N>::variables(x));
        let pattern = Pattern::new(N, depends.iter().cloned()).unwrap();
        assert_eq!(Pattern::detect(|x| tangled(depends, x), &x), pattern);
        let (forward, reverse) = (Forward::new(pattern.clone()), Reverse::new(pattern.clone()));
        let results = [
            forward.evaluate(|x| tangled(depends, x), &x).unwrap(),
            reverse.evaluate(|x| tangled(depends, x), &x).unwrap(),
        ];
        for (values, entries) in results {
            assert_eq!(values, dense.iter().map(|y| y.value).collect::<Vec<_>>());
            let mut entries = entries.iter();
            for (row, output) in dense.iter().enumerate() {
                for &column in pattern.row(row) {
                    let (entry, exact) = (entries.next().unwrap(), output.derivative[column]);
                    assert!((entry - exact).abs() < 1e-12 * (1.0 + exact.abs()), "{row} {column}");
                }
            }
            assert!(entries.next().is_none());
        }
        [forward.colors(), reverse.colors()]
    }

    #[test]
    fn tridiagonal_jacobians_need_three_colors() {
        let depends: Vec<Vec<usize>> =
            (0..N).map(|i| (i.saturating_sub(1)..(i + 2).min(N)).collect()).collect();
        assert_eq!(assert_like_dense(&depends), [3, 3]);
    }

    #[test]
    fn arrows_are_cheap_from_one_side() {
        let columns: Vec<Vec<usize>> =
            (0..N).map(|i| if i == 0 { vec![0] } else { vec![0, i] }).collect();
        assert_eq!(assert_like_dense(&columns), [2, N]);
        let mut rows: Vec<Vec<usize>> = (0..N).map(|i| vec![i]).collect();
        rows[0] = (0..N).collect();
        assert_eq!(assert_like_dense(&rows), [N, 2]);
        rows.iter_mut().skip(1).for_each(|row| row.insert(0, 0));
        assert_eq!(assert_like_dense(&rows), [N, N]);
    }

    #[test]
    fn random_jacobians_equal_dense_ones() {
        let mut state = 3_u64;
        let mut random = |below: usize| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as usize % below
        };
        for rows in [1, 25, 90] {
            let depends: Vec<Vec<usize>> = (0..rows)
                .map(|_| {
                    // Rows of none to eight; columns from 30 on stay empty.
                    let mut row: Vec<usize> = (0..random(9)).map(|_| random(30)).collect();
                    row.sort_unstable();
                    row.dedup();
                    row
                })
                .collect();
            let [forward, reverse] = assert_like_dense(&depends);
            assert!(forward < 30 && reverse < rows.max(2), "{forward} {reverse}");
        }
    }

    #[test]
    fn empty_jacobians_still_have_values() {
        assert_eq!(assert_like_dense(&[]), [1, 0]);
        assert_eq!(assert_like_dense(&[vec![], vec![]]), [1, 1]);
        let pattern = Pattern::new(0, [[0; 0]]).unwrap();
        let forward = Forward::new(pattern.clone()).evaluate(|_| vec![Fwd::from(2.0)], &[]);
        let reverse = Reverse::new(pattern).evaluate(|_| vec![Var::from(2.0)], &[]);
        assert_eq!((forward, reverse), (Ok((vec![2.0], vec![])), Ok((vec![2.0], vec![]))));
    }

    #[test]
    fn what_does_not_fit_the_pattern_is_refused() {
        fn f<S: Scalar>(x: &[S]) -> Vec<S> {
            vec![x[0] * x[1], x[1].sin(), x[2]]
        }
        let x = [1.0, 2.0, 3.0];
        let right = Pattern::detect(f, &x);
        let both = |pattern: &Pattern, x: &[f64]| {
            let forward = Forward::new(pattern.clone()).evaluate(f, x);
            let reverse = Reverse::new(pattern.clone()).evaluate(f, x);
            [forward, reverse].map(Result::unwrap_err)
        };
        let inputs = SparseError::InputCount { expected: 3, found: 2 };
        assert_eq!(both(&right, &x[..2]), [inputs.clone(), inputs]);
        let outputs = SparseError::OutputCount { expected: 2, found: 3 };
        let short = Pattern::new(3, [vec![0, 1], vec![1]]).unwrap();
        assert_eq!(both(&short, &x), [outputs.clone(), outputs]);
        let lacking = Pattern::new(3, [vec![0, 1], vec![1], vec![]]).unwrap();
        assert_eq!(
            both(&lacking, &x),
            [
                SparseError::RowOutsidePattern { row: 2 },
                SparseError::ColumnOutsidePattern { column: 2 }
            ]
        );
    }
}
