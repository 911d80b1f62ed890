//! Sums over squares of pixels.

/// Sums over the square about each pixel.
#[derive(Clone, Debug, Default)]
pub(crate) struct BoxSums {
    pub(crate) all: Vec<f32>,
    across: Vec<f32>,
    /// Sum of each column over the rows at hand.
    column: Vec<f32>,
}

impl BoxSums {
    /// Finds those of `values` over squares that reach `reach` pixels to all sides; of whole numbers they are exact.
    pub(crate) fn find(&mut self, values: &[f32], (columns, rows): (usize, usize), reach: usize) {
        let Self { all, across, column } = self;
        for sums in [&mut *all, &mut *across] {
            sums.clear();
            sums.resize(values.len(), 0.0);
        }
        for (line, sums) in values.chunks(columns).zip(across.chunks_mut(columns)) {
            let mut sum: f32 = line[..reach.min(columns)].iter().sum();
            for i in 0..columns {
                if let Some(next) = line.get(i + reach) {
                    sum += next;
                }
                sums[i] = sum;
                if i >= reach {
                    sum -= line[i - reach];
                }
            }
        }
        // All columns at once, row by row: memory is read as it lies.
        let line = |row: usize| &across[row * columns..(row + 1) * columns];
        column.clear();
        column.resize(columns, 0.0);
        for row in 0..reach.min(rows) {
            column.iter_mut().zip(line(row)).for_each(|(sum, value)| *sum += value);
        }
        for (row, sums) in all.chunks_mut(columns).enumerate() {
            if row + reach < rows {
                column.iter_mut().zip(line(row + reach)).for_each(|(sum, value)| *sum += value);
            }
            sums.copy_from_slice(column);
            if row >= reach {
                column.iter_mut().zip(line(row - reach)).for_each(|(sum, value)| *sum -= value);
            }
        }
    }
}

/// How many of `size` pixels in a line are within `reach` of number `at`.
pub(crate) fn squares(at: usize, size: usize, reach: usize) -> usize {
    (at + reach + 1).min(size) - at.saturating_sub(reach)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_whole_numbers_are_exact() {
        let (columns, rows) = (13, 9);
        let value = |k: usize| f32::from(u8::from((k * 7).is_multiple_of(5)));
        let values: Vec<f32> = (0..columns * rows).map(value).collect();
        let mut sums = BoxSums::default();
        sums.find(&values, (columns, rows), 2);
        for (k, found) in sums.all.iter().enumerate() {
            let (x, y) = (k % columns, k / columns);
            let near = |i: &usize| (i % columns).abs_diff(x) <= 2 && (i / columns).abs_diff(y) <= 2;
            let expected: f32 = (0..values.len()).filter(near).map(|i| values[i]).sum();
            assert_eq!(*found, expected);
            let count = squares(x, columns, 2) * squares(y, rows, 2);
            assert_eq!(count, (0..values.len()).filter(near).count());
        }
        // Windows that are smaller than what they are summed over.
        sums.find(&[1.0, 2.0], (2, 1), 5);
        assert_eq!(sums.all, [3.0, 3.0]);
    }
}
