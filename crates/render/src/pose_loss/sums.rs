//! Sums of losses and their normal equations.

#![allow(clippy::needless_range_loop)] // loops over lanes index several arrays alike

use std::collections::BTreeMap;

use nalgebra::{Matrix6, Vector6};

use super::counts::Counts;
use super::loss::{Linearized, Loss};
use super::target::Target;
use crate::view::{LANES, Lane, Row};

/// Σ w r J and the upper triangle of Σ w JᵀJ, row by row.
pub(crate) const ENTRIES: usize = 27;

/// Sums over some pixels; added up in a fixed order.
#[derive(Clone, Debug)]
pub(crate) struct Sums {
    pub(crate) color: f64,
    pub(crate) mask: f64,
    pub(crate) depth: f64,
    pub(crate) counts: Counts,
    equations: [f64; ENTRIES],
    /// The part of the image row at hand, still in f32.
    row: [f32; ENTRIES],
}

/// [`Sums`] lane by lane, over pixels side by side of one block of rows.
pub(crate) struct LaneSums {
    pub(crate) color: [f64; LANES],
    pub(crate) mask: [f64; LANES],
    pub(crate) depth: [f64; LANES],
    equations: [Lane; ENTRIES],
}

impl LaneSums {
    pub(crate) fn new() -> Self {
        Self {
            color: [0.0; LANES],
            mask: [0.0; LANES],
            depth: [0.0; LANES],
            equations: [[0.0; LANES]; ENTRIES],
        }
    }

    /// Adds in each lane `N` residuals with derivatives `rows` and weights `weights`.
    #[inline(always)]
    pub(crate) fn add<const N: usize>(
        &mut self,
        rows: &[[Lane; 6]; N],
        residuals: &[Lane; N],
        weights: &[Lane; N],
    ) {
        for l in 0..LANES {
            let mut at = 6;
            for i in 0..6 {
                let mut scaled = [0.0; N];
                let mut sum = 0.0;
                for k in 0..N {
                    scaled[k] = weights[k][l] * rows[k][i][l];
                    sum += scaled[k] * residuals[k][l];
                }
                self.equations[i][l] += sum;
                for j in i..6 {
                    let mut sum = 0.0;
                    for k in 0..N {
                        sum += scaled[k] * rows[k][j][l];
                    }
                    self.equations[at][l] += sum;
                    at += 1;
                }
            }
        }
    }
}

impl Sums {
    pub(crate) fn new() -> Self {
        Self {
            color: 0.0,
            mask: 0.0,
            depth: 0.0,
            counts: Counts::default(),
            equations: [0.0; ENTRIES],
            row: [0.0; ENTRIES],
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

    /// Adds what lies side by side, lane after lane.
    pub(crate) fn absorb(&mut self, lanes: &LaneSums) {
        self.color += lanes.color.iter().sum::<f64>();
        self.mask += lanes.mask.iter().sum::<f64>();
        self.depth += lanes.depth.iter().sum::<f64>();
        for (sum, lane) in self.equations.iter_mut().zip(&lanes.equations) {
            *sum += lane.iter().map(|v| *v as f64).sum::<f64>();
        }
    }

    /// The sums of all tiles together.
    pub(crate) fn total(tiles: &BTreeMap<[usize; 2], Self>) -> Self {
        let mut total = Self::new();
        tiles.values().for_each(|sums| total.merge(sums));
        total
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

    pub(crate) fn loss(&self, target: &Target) -> Loss {
        Loss::new([self.color, self.mask, self.depth], self.counts, target)
    }

    /// The loss with its derivatives.
    pub(crate) fn linearized(&self, target: &Target) -> Linearized {
        let (gradient, hessian) = self.equations(target.normalization);
        Linearized { loss: self.loss(target), gradient, hessian }
    }

    /// Σ w r J and Σ w JᵀJ, each times `factor`.
    pub(super) fn equations(&self, factor: f64) -> (Vector6<f64>, Matrix6<f64>) {
        unpacked(&self.equations, factor)
    }
}

/// Σ w r J and Σ w JᵀJ, each times `factor`, from their entries.
pub(crate) fn unpacked(entries: &[f64; ENTRIES], factor: f64) -> (Vector6<f64>, Matrix6<f64>) {
    let right = Vector6::from_fn(|i, _| factor * entries[i]);
    let mut matrix = Matrix6::zeros();
    let mut at = 6;
    for i in 0..6 {
        for j in i..6 {
            matrix[(i, j)] = factor * entries[at];
            matrix[(j, i)] = matrix[(i, j)];
            at += 1;
        }
    }
    (right, matrix)
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

    #[test]
    fn lanes_add_up_to_the_same() {
        let row = |l: usize, k: usize| -> Row {
            std::array::from_fn(|i| ((l * 7 + k * 3 + i * 5) % 11) as f32 - 4.0)
        };
        let (mut sums, mut side_by_side) = (Sums::new(), Sums::new());
        let mut lanes = LaneSums::new();
        let mut rows = [[[0.0; LANES]; 6]; 2];
        let (mut residuals, mut weights) = ([[0.0; LANES]; 2], [[0.0; LANES]; 2]);
        for l in 0..LANES {
            for k in 0..2 {
                (0..6).for_each(|i| rows[k][i][l] = row(l, k)[i]);
                residuals[k][l] = l as f32 - 9.0;
                weights[k][l] = 1.0 + k as f32;
                sums.add(&row(l, k), residuals[k][l], weights[k][l]);
            }
        }
        sums.end_row();
        lanes.add(&rows, &residuals, &weights);
        side_by_side.absorb(&lanes);
        assert_eq!(sums.equations(1.0), side_by_side.equations(1.0));
    }
}
