//! Where a Jacobian may be other than zero.

use super::error::SparseError;
use crate::fwd::Fwd;

/// Directions in one evaluation of [`Forward`](super::Forward).
pub const LANES: usize = 8;

/// The entries of a matrix that may differ from zero, in compressed rows (CSR).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    columns: usize,
    starts: Vec<usize>,
    indices: Vec<usize>,
}

impl Pattern {
    /// The pattern of a matrix of `columns` columns whose rows hold the given column numbers, in any order.
    ///
    /// # Errors
    /// [`SparseError::NoSuchColumn`] if a number is not below `columns`.
    pub fn new<R>(columns: usize, rows: impl IntoIterator<Item = R>) -> Result<Self, SparseError>
    where
        R: IntoIterator<Item = usize>,
    {
        let mut pattern = Self { columns, starts: vec![0], indices: Vec::new() };
        for row in rows {
            let mut row: Vec<usize> = row.into_iter().collect();
            row.sort_unstable();
            row.dedup();
            if let Some(&column) = row.last().filter(|column| **column >= columns) {
                return Err(SparseError::NoSuchColumn { row: pattern.rows(), column, columns });
            }
            pattern.push(row);
        }
        Ok(pattern)
    }

    /// The pattern of `f`'s Jacobian along the branches that `f` takes at `x`, found in `x.len()` / 8
    /// evaluations: quadratic in the size of large systems, whose pattern is better given where it is known.
    ///
    /// An entry counts if the output is computed from the input, even if the derivative vanishes at `x`. What
    /// other branches depend on is missed, and so is what passes through a function of slope zero
    /// everywhere, such as rounding.
    pub fn detect(f: impl Fn(&[Fwd<LANES>]) -> Vec<Fwd<LANES>>, x: &[f64]) -> Self {
        let mut rows: Vec<Vec<usize>> = Vec::new();
        for first in (0..x.len().max(1)).step_by(LANES) {
            let inputs: Vec<Fwd<LANES>> = x
                .iter()
                .enumerate()
                .map(|(column, &value)| {
                    let mut input = Fwd::from(value);
                    // Unlike any number, a NaN survives slopes of zero and sums that cancel.
                    if (first..first + LANES).contains(&column) {
                        input.derivative[column - first] = f64::NAN;
                    }
                    input
                })
                .collect();
            let outputs = f(&inputs);
            rows.resize_with(rows.len().max(outputs.len()), Vec::new);
            for (row, output) in rows.iter_mut().zip(&outputs) {
                row.extend((0..LANES).filter(|&l| output.derivative[l] != 0.0).map(|l| first + l));
            }
        }
        let mut pattern = Self { columns: x.len(), starts: vec![0], indices: Vec::new() };
        rows.into_iter().for_each(|row| pattern.push(row));
        pattern
    }

    /// Appends a row of rising column numbers.
    fn push(&mut self, row: Vec<usize>) {
        self.indices.extend(row);
        self.starts.push(self.indices.len());
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Columns of the entries of row `row`, rising.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn row(&self, row: usize) -> &[usize] {
        &self.indices[self.starts[row]..self.starts[row + 1]]
    }

    /// Where each row's entries begin in [`Self::column_indices`] and in the values of a Jacobian, and at last
    /// the number of entries.
    pub fn row_starts(&self) -> &[usize] {
        &self.starts
    }

    /// Columns of all the entries, row by row.
    pub fn column_indices(&self) -> &[usize] {
        &self.indices
    }

    /// Rows and columns exchanged.
    pub(super) fn transposed(&self) -> Self {
        let mut starts = vec![0; self.columns + 1];
        self.indices.iter().for_each(|&column| starts[column + 1] += 1);
        (0..self.columns).for_each(|column| starts[column + 1] += starts[column]);
        let (mut next, mut indices) = (starts.clone(), vec![0; self.indices.len()]);
        for row in 0..self.rows() {
            for &column in self.row(row) {
                indices[next[column]] = row;
                next[column] += 1;
            }
        }
        Self { columns: self.rows(), starts, indices }
    }
}

#[cfg(test)]
mod tests {

    use super::*;
    use crate::scalar::Scalar;

    #[test]
    fn rows_are_sorted_and_checked() {
        let pattern = Pattern::new(4, [vec![2, 0, 2], vec![], vec![3]]).unwrap();
        assert_eq!((pattern.rows(), pattern.columns()), (3, 4));
        assert_eq!(pattern.row_starts(), [0, 2, 2, 3]);
        assert_eq!(pattern.column_indices(), [0, 2, 3]);
        assert_eq!(
            Pattern::new(4, [vec![0], vec![9, 1, 4]]),
            Err(SparseError::NoSuchColumn { row: 1, column: 9, columns: 4 })
        );
    }

    #[test]
    fn transposing_twice_changes_nothing() {
        let pattern = Pattern::new(5, [vec![0, 3], vec![], vec![1, 3], vec![0]]).unwrap();
        let transposed = pattern.transposed();
        let expected = Pattern::new(4, [vec![0, 3], vec![2], vec![], vec![0, 2], vec![]]).unwrap();
        assert_eq!(transposed, expected);
        assert_eq!(transposed.transposed(), pattern);
    }

    #[test]
    fn what_vanishes_at_the_point_is_found_and_what_is_not_used_is_not() {
        fn f<S: Scalar>(x: &[S]) -> Vec<S> {
            let last = x.len() - 1;
            let branch = if x[1] > S::zero() { x[3] } else { x[4] };
            vec![
                x[0] * x[0] * x[last],
                x[1] - x[1] + x[2].cos(),
                S::constant(3.0),
                branch * S::zero() + (x[8] * x[9]).powi(2),
                x[0].powf(x[2]),
            ]
        }
        let pattern = Pattern::detect(f, &[0.0; 19]);
        let expected = [vec![0, 18], vec![1, 2], vec![], vec![4, 8, 9], vec![0, 2]];
        assert_eq!(pattern, Pattern::new(19, expected).unwrap());
    }

    #[test]
    fn functions_of_nothing_have_rows_too() {
        let pattern = Pattern::detect(|_| vec![Fwd::from(1.0); 3], &[]);
        assert_eq!((pattern.rows(), pattern.columns()), (3, 0));
    }
}
