//! Sums of squared residuals and their normal equations.

use nalgebra::{Matrix6, Vector6};

use super::pixel::Row;

/// Numbers of pixels by what became of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// The object is seen here.
    pub covered: usize,
    /// Within the contour band (inside and outside).
    pub contour: usize,
    /// The object or its band lies behind a known body: no residual.
    pub hidden: usize,
    /// In the mask but not covered by the object, nor in its band.
    pub missed: usize,
    /// Depth was compared.
    pub depth: usize,
}

/// Sums over some pixels; added up in a fixed order.
#[derive(Clone, Debug)]
pub(crate) struct Sums {
    pub(crate) color: f64,
    pub(crate) mask: f64,
    pub(crate) depth: f64,
    pub(crate) counts: Counts,
    /// Σ w r J and the upper triangle of Σ w JᵀJ, row by row.
    equations: [f64; 27],
    /// The part of the image row at hand, still in f32.
    row: [f32; 27],
}

impl Sums {
    pub(crate) fn new() -> Self {
        Self {
            color: 0.0,
            mask: 0.0,
            depth: 0.0,
            counts: Counts::default(),
            equations: [0.0; 27],
            row: [0.0; 27],
        }
    }

    /// Adds residual `r` with derivative `row` and weight `weight` to the normal equations.
    #[inline]
    pub(crate) fn add(&mut self, row: &Row, r: f32, weight: f32) {
        let mut at = 6;
        for i in 0..6 {
            let scaled = weight * row[i];
            self.row[i] += scaled * r;
            for value in &row[i..] {
                self.row[at] += scaled * value;
                at += 1;
            }
        }
    }

    /// To be called after each image row: short f32 sums keep their precision.
    pub(crate) fn end_row(&mut self) {
        for (sum, part) in self.equations.iter_mut().zip(&mut self.row) {
            *sum += *part as f64;
            *part = 0.0;
        }
    }

    /// Adds what another block of rows summed up.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.color += other.color;
        self.mask += other.mask;
        self.depth += other.depth;
        self.counts.covered += other.counts.covered;
        self.counts.contour += other.counts.contour;
        self.counts.hidden += other.counts.hidden;
        self.counts.missed += other.counts.missed;
        self.counts.depth += other.counts.depth;
        self.equations.iter_mut().zip(&other.equations).for_each(|(a, b)| *a += b);
    }

    /// Σ w r J and Σ w JᵀJ, each times `factor`.
    pub(crate) fn equations(&self, factor: f64) -> (Vector6<f64>, Matrix6<f64>) {
        let right = Vector6::from_fn(|i, _| factor * self.equations[i]);
        let mut matrix = Matrix6::zeros();
        let mut at = 6;
        for i in 0..6 {
            for j in i..6 {
                matrix[(i, j)] = factor * self.equations[at];
                matrix[(j, i)] = matrix[(i, j)];
                at += 1;
            }
        }
        (right, matrix)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_are_those_of_the_rows() {
        let rows = [[1.0, -2.0, 0.5, 3.0, 0.25, -1.0], [0.5, 1.0, -1.5, 2.0, 4.0, 0.125]];
        let (mut whole, mut part) = (Sums::new(), Sums::new());
        whole.add(&rows[0], 0.5, 2.0);
        whole.end_row();
        part.add(&rows[1], -1.0, 1.0);
        part.end_row();
        whole.merge(&part);
        let (right, matrix) = whole.equations(3.0);
        for i in 0..6 {
            let expected = 3.0 * (2.0 * 0.5 * rows[0][i] - rows[1][i]);
            assert!((right[i] - expected as f64).abs() < 1e-12);
            for j in 0..6 {
                let expected = 3.0 * (2.0 * rows[0][i] * rows[0][j] + rows[1][i] * rows[1][j]);
                assert!((matrix[(i, j)] - expected as f64).abs() < 1e-12);
            }
        }
    }
}
