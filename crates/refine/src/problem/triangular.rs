//! Triangular factors of large matrices.
//!
//! As nalgebra has them, to the bit, but with several columns at once: each number is read from memory a quarter of the times, which is half
//! of the work where a matrix has a hundred columns and more.

use nalgebra::DMatrix;

/// Columns that are taken at once.
const AT_ONCE: usize = 4;

/// Cholesky's factor of a symmetric matrix, of which the lower half is read, in the lower half of what is returned; `None` if it is not positive
/// definite.
pub(super) fn cholesky(mut matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = matrix.nrows();
    let all = matrix.as_mut_slice();
    for j in 0..n {
        let (done, own) = all.split_at_mut(j * n);
        let own = &mut own[j..n];
        let groups = done.chunks_exact(AT_ONCE * n);
        let rest = groups.remainder();
        for group in groups {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| &group[k * n + j..(k + 1) * n]);
            let factors = [-a[0], -b[0], -c[0], -d[0]];
            for ((((y, a), b), c), d) in own.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                *y += factors[0] * a;
                *y += factors[1] * b;
                *y += factors[2] * c;
                *y += factors[3] * d;
            }
        }
        for column in rest.chunks_exact(n) {
            let factor = -column[j];
            own.iter_mut().zip(&column[j..]).for_each(|(y, x)| *y += factor * x);
        }
        // Not above zero if it is not a number.
        let root = Some(own[0]).filter(|square| *square > 0.0)?.sqrt();
        own[0] = root;
        own[1..].iter_mut().for_each(|value| *value /= root);
    }
    Some(matrix)
}

/// Solves L X = B in place of B, where L is the lower half of `lower`, a Cholesky factor.
pub(super) fn solve_lower(lower: &DMatrix<f64>, right: &mut [f64]) {
    let n = lower.nrows();
    let factor = lower.as_slice();
    let mut groups = right.chunks_exact_mut(AT_ONCE * n.max(1));
    for group in &mut groups {
        let (a, rest) = group.split_at_mut(n);
        let (b, rest) = rest.split_at_mut(n);
        let (c, d) = rest.split_at_mut(n);
        for i in 0..n {
            let column = &factor[i * n..(i + 1) * n];
            let found = [&mut *a, &mut *b, &mut *c, &mut *d].map(|side| {
                side[i] /= column[i];
                -side[i]
            });
            let sides = a[i + 1..].iter_mut().zip(&mut b[i + 1..]);
            let sides = sides.zip(&mut c[i + 1..]).zip(&mut d[i + 1..]);
            for ((((a, b), c), d), x) in sides.zip(&column[i + 1..]) {
                *a += found[0] * x;
                *b += found[1] * x;
                *c += found[2] * x;
                *d += found[3] * x;
            }
        }
    }
    for side in groups.into_remainder().chunks_exact_mut(n.max(1)) {
        for i in 0..n {
            let column = &factor[i * n..(i + 1) * n];
            side[i] /= column[i];
            let found = -side[i];
            let below = side[i + 1..].iter_mut().zip(&column[i + 1..]);
            below.for_each(|(y, x)| *y += found * x);
        }
    }
}

#[cfg(test)]
mod tests {
    use prehend_geometry::SplitMix64;

    use super::*;

    #[test]
    fn factors_and_solutions_are_those_of_nalgebra_to_the_bit() {
        let mut random = SplitMix64::new(3);
        for (n, sides) in [(1, 1), (3, 2), (8, 4), (37, 9), (64, 33)] {
            let root = DMatrix::from_fn(n, n, |_, _| random.normal());
            let matrix = &root * root.transpose() + DMatrix::identity(n, n);
            let expected = matrix.clone().cholesky().unwrap();
            let found = cholesky(matrix).unwrap();
            assert_eq!(found.lower_triangle(), expected.l());
            let right = DMatrix::from_fn(n, sides, |_, _| random.normal());
            let mut solution = right.clone();
            solve_lower(&found, solution.as_mut_slice());
            assert_eq!(Some(solution), expected.l_dirty().solve_lower_triangular(&right));
        }
        assert!(cholesky(DMatrix::from_diagonal_element(3, 3, -1.0)).is_none());
        assert!(cholesky(DMatrix::from_diagonal_element(3, 3, f64::NAN)).is_none());
        assert!(cholesky(DMatrix::zeros(2, 2)).is_none());
    }
}
