//! Grouping the lines (rows or columns) of a matrix so that no two of a group have an entry in common.
//!
//! A. R. Curtis, M. J. D. Powell, J. K. Reid, "On the estimation of sparse Jacobian matrices", J. Inst. Maths
//! Applics 13 (1974); as graph coloring: T. F. Coleman, J. J. Moré, SIAM J. Numer. Anal. 20 (1983), and
//! A. H. Gebremedhin, F. Manne, A. Pothen, "What color is your Jacobian?", SIAM Rev. 47 (2005).

use std::cmp::Reverse;

use super::pattern::Pattern;

/// A color for each line; lines of one color meet no crossing line twice.
pub(super) struct Coloring {
    pub(super) of_line: Vec<usize>,
    pub(super) count: usize,
}

impl Coloring {
    /// Colors the rows of `lines`, whose transpose is `crossing`: greedily, those with the most neighbors first.
    pub(super) fn new(lines: &Pattern, crossing: &Pattern) -> Self {
        let neighbors = |line: usize| lines.row(line).iter().flat_map(|&other| crossing.row(other));
        let count = lines.rows();
        let mut last_seen_from = vec![usize::MAX; count];
        let degrees: Vec<usize> = (0..count)
            .map(|line| {
                let first = |&&n: &&usize| std::mem::replace(&mut last_seen_from[n], line) != line;
                neighbors(line).filter(first).count()
            })
            .collect();
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|&line| Reverse(degrees[line]));

        let (mut of_line, mut colors) = (vec![usize::MAX; count], 0);
        let mut last_barred_for = vec![usize::MAX; count];
        for line in order {
            for &neighbor in neighbors(line) {
                if let Some(barred) = last_barred_for.get_mut(of_line[neighbor]) {
                    *barred = line;
                }
            }
            let color = (0..colors).find(|&c| last_barred_for[c] != line).unwrap_or(colors);
            of_line[line] = color;
            colors = colors.max(color + 1);
        }
        Self { of_line, count: colors }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_columns(pattern: &Pattern) -> Coloring {
        let coloring = Coloring::new(&pattern.transposed(), pattern);
        for row in 0..pattern.rows() {
            let mut colors: Vec<usize> =
                pattern.row(row).iter().map(|&c| coloring.of_line[c]).collect();
            colors.sort_unstable();
            colors.dedup();
            assert_eq!(colors.len(), pattern.row(row).len(), "row {row} sees a color twice");
            assert!(colors.iter().all(|c| *c < coloring.count));
        }
        coloring
    }

    #[test]
    fn bands_need_as_many_colors_as_they_are_wide() {
        for (below, above) in [(0, 0), (1, 1), (2, 2), (3, 1), (0, 4)] {
            for n in [below + above + 1, 17, 100] {
                let rows = (0..n).map(|i: usize| i.saturating_sub(below)..(i + above + 1).min(n));
                let coloring = of_columns(&Pattern::new(n, rows).unwrap());
                assert_eq!(coloring.count, below + above + 1, "{n} {below} {above}");
            }
        }
    }

    #[test]
    fn an_arrow_needs_two_colors_across_its_dense_line_only() {
        let n = 30;
        // Dense last column.
        let pattern = Pattern::new(n, (0..n).map(|i| [i, n - 1])).unwrap();
        assert_eq!(of_columns(&pattern).count, 2);
        assert_eq!(of_columns(&pattern.transposed()).count, n);
    }

    #[test]
    fn lines_with_many_neighbors_come_first() {
        // A path 0 – 2 – 3 – 1, which takes three colors if its ends come first.
        assert_eq!(of_columns(&Pattern::new(4, [[0, 2], [2, 3], [3, 1]]).unwrap()).count, 2);
    }

    #[test]
    fn empty_lines_share_the_first_color() {
        let coloring = of_columns(&Pattern::new(4, [vec![], vec![1, 3], vec![]]).unwrap());
        assert_eq!((coloring.count, coloring.of_line[0], coloring.of_line[2]), (2, 0, 0));
        assert_eq!(of_columns(&Pattern::new(0, [[0; 0]]).unwrap()).count, 0);
        assert_eq!(of_columns(&Pattern::new(3, [[0; 0]; 0]).unwrap()).count, 1);
    }

    #[test]
    fn random_patterns_are_colored_near_the_lower_bound() {
        let mut state = 7_u64;
        let mut random = |below: usize| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as usize % below
        };
        for n in [10, 50, 300] {
            let rows: Vec<Vec<usize>> =
                (0..n).map(|_| (0..random(6)).map(|_| random(n)).collect()).collect();
            let pattern = Pattern::new(n, rows).unwrap();
            let widest = (0..n).map(|row| pattern.row(row).len()).max().unwrap();
            let colors = of_columns(&pattern).count;
            assert!((widest..=widest + 3).contains(&colors), "{n}: {colors} for {widest}");
        }
    }
}
