//! Connected parts of a mask.

/// The pixels of the largest connected part of what is `set`, and of others that are not far smaller, for fingers part what they hold, in rows of so many columns.
pub(super) fn large_parts(set: &[bool], columns: usize, least_share: f64) -> Vec<bool> {
    let least = least_share as f32;
    let mut part = vec![0_u32; set.len()];
    let mut sizes = vec![0_u32];
    let mut left = Vec::new();
    for start in 0..set.len() {
        if !set[start] || part[start] != 0 {
            continue;
        }
        let own = sizes.len() as u32;
        let mut size = 0;
        part[start] = own;
        left.push(start);
        while let Some(k) = left.pop() {
            size += 1;
            let column = k % columns;
            let neighbors = [
                (column > 0).then(|| k - 1),
                (column + 1 < columns).then_some(k + 1),
                k.checked_sub(columns),
                (k + columns < set.len()).then_some(k + columns),
            ];
            for next in neighbors.into_iter().flatten().filter(|next| set[*next]) {
                if part[next] == 0 {
                    part[next] = own;
                    left.push(next);
                }
            }
        }
        sizes.push(size);
    }
    let largest = sizes.iter().copied().max().unwrap_or_default();
    let kept = |part: &u32| *part > 0 && sizes[*part as usize] as f32 >= least * largest as f32;
    part.iter().map(kept).collect()
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
        let kept = large_parts(&set, 10, 0.1);
        assert_eq!(kept.iter().filter(|k| **k).count(), 20);
        assert!(!kept[99] && kept[66] && kept[33]);
        // The end of a row and the start of the next are no neighbors.
        let row = large_parts(&[true, true, true, false, false, true, true, false, false], 3, 0.1);
        assert_eq!(row.iter().filter(|k| **k).count(), 5);
        let apart = large_parts(&[false, false, true, true, false, false], 3, 0.1);
        assert_eq!(apart.iter().filter(|k| **k).count(), 2);
        assert!(large_parts(&[], 1, 0.1).is_empty());
    }
}
