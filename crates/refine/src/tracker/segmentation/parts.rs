//! Connected parts of a mask.

use std::cmp::Reverse;
use std::mem;

/// Indices of the pixels of each connected part of what is `set`, in rows of `columns`: of the largest first, and of others that are not far smaller,
/// for fingers part what they hold.
pub(super) fn large_parts(set: &[bool], columns: usize, least_share: f64) -> Vec<Vec<usize>> {
    let mut left = set.to_vec();
    let mut parts: Vec<Vec<usize>> = Vec::new();
    for start in 0..set.len() {
        if !mem::take(&mut left[start]) {
            continue;
        }
        let mut part = vec![start];
        let mut next = 0;
        while let Some(&k) = part.get(next) {
            next += 1;
            let column = k % columns;
            let neighbors = [
                (column > 0).then(|| k - 1),
                (column + 1 < columns).then_some(k + 1),
                k.checked_sub(columns),
                (k + columns < set.len()).then_some(k + columns),
            ];
            part.extend(neighbors.into_iter().flatten().filter(|k| mem::take(&mut left[*k])));
        }
        parts.push(part);
    }
    let largest = parts.iter().map(Vec::len).max().unwrap_or_default();
    parts.retain(|part| part.len() as f64 >= least_share * largest as f64);
    parts.sort_by_key(|part| Reverse(part.len()));
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn specks_go_and_large_parts_stay() {
        // A block of 16, one of 4, and a speck.
        let mut set = vec![false; 100];
        for (x, y) in (0..4).flat_map(|x| (0..4).map(move |y| (x, y))) {
            set[10 * y + x] = true;
        }
        for k in [66, 67, 76, 77, 99] {
            set[k] = true;
        }
        let sizes = |parts: &[Vec<usize>]| parts.iter().map(Vec::len).collect::<Vec<_>>();
        let kept = large_parts(&set, 10, 0.1);
        assert_eq!(sizes(&kept), [16, 4]);
        assert!(kept[0].contains(&33) && kept[1].contains(&66));
        // The end of a row and the start of the next are no neighbors.
        let row = large_parts(&[true, true, true, false, false, true, true, false, false], 3, 0.1);
        assert_eq!(sizes(&row), [4, 1]);
        let apart = large_parts(&[false, false, true, true, false, false], 3, 0.1);
        assert_eq!(sizes(&apart), [1, 1]);
        assert!(large_parts(&[], 1, 0.1).is_empty());
    }
}
