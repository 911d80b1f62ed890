//! The factor of a mass matrix that has the branches of its tree.

use std::borrow::Cow;

use nalgebra::DMatrix;

/// L of M = Lᵀ L, lower triangular: entries are zero where neither degree of freedom moves the other (Featherstone, section 6.5).
pub(crate) struct TreeFactor<'a> {
    lower: DMatrix<f64>,
    /// For each degree of freedom: the one that carries it.
    parents: Cow<'a, [Option<usize>]>,
}

impl<'a> TreeFactor<'a> {
    /// Factor of a mass matrix; `None` if it is not positive definite.
    pub(crate) fn new(
        mass: &DMatrix<f64>,
        parents: impl Into<Cow<'a, [Option<usize>]>>,
    ) -> Option<Self> {
        let (mut lower, parents) = (mass.clone(), parents.into());
        for k in (0..parents.len()).rev() {
            let pivot = lower[(k, k)];
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            let root = pivot.sqrt();
            lower[(k, k)] = root;
            for i in carriers(&parents, k) {
                lower[(k, i)] /= root;
            }
            for i in carriers(&parents, k) {
                let factor = lower[(k, i)];
                lower[(i, i)] -= factor * factor;
                for j in carriers(&parents, i) {
                    lower[(i, j)] -= factor * lower[(k, j)];
                }
            }
        }
        Some(Self { lower, parents })
    }

    /// M⁻¹ B in place of B, where column i of `transposed` is row i of B: whole rows are added to each other.
    pub(crate) fn solve_transposed(&self, transposed: &mut DMatrix<f64>) {
        let n = self.parents.len();
        for i in (0..n).rev() {
            transposed.column_mut(i).unscale_mut(self.lower[(i, i)]);
            for j in carriers(&self.parents, i) {
                subtract(transposed, j, i, self.lower[(i, j)]);
            }
        }
        for i in 0..n {
            for j in carriers(&self.parents, i) {
                subtract(transposed, i, j, self.lower[(i, j)]);
            }
            transposed.column_mut(i).unscale_mut(self.lower[(i, i)]);
        }
    }
}

/// The degrees of freedom that carry `dof`, the nearest first.
fn carriers(parents: &[Option<usize>], dof: usize) -> impl Iterator<Item = usize> {
    std::iter::successors(parents[dof], |k| parents[*k])
}

/// Column `to` −= `factor` · column `from`.
#[inline]
fn subtract(matrix: &mut DMatrix<f64>, to: usize, from: usize, factor: f64) {
    let rows = matrix.nrows();
    let (low, high) = (to.min(from), to.max(from));
    let (before, after) = matrix.as_mut_slice().split_at_mut(high * rows);
    let (low, high) = (&mut before[low * rows..(low + 1) * rows], &mut after[..rows]);
    let (target, source) = if to < from { (low, high) } else { (high, low) };
    for (target, source) in target.iter_mut().zip(source.iter()) {
        *target -= factor * source;
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{random_state, random_tree};
    use super::*;

    #[test]
    fn it_solves_as_the_whole_matrix_does() {
        for seed in 0..12 {
            let tree = random_tree(seed, 3 + seed as usize);
            let (q, v, _) = random_state(&tree, seed);
            let mass = tree.kinematics(&q, &v).mass_matrix();
            let factor = TreeFactor::new(&mass, tree.carriers()).unwrap();
            let n = mass.nrows();
            let right = DMatrix::from_fn(n, 3, |r, c| ((r + 5 * c) as f64).sin());
            let mut transposed = right.transpose();
            factor.solve_transposed(&mut transposed);
            assert!((mass * transposed.transpose() - right).amax() < 1e-9);
        }
        assert!(TreeFactor::new(&DMatrix::zeros(1, 1), &[None]).is_none());
    }
}
