//! Rows of a lattice on the flat part of a face.

use prehend_autodiff::Scalar;

/// Part of the spacing by which distances may be larger, so that no sample is added as a length that was a multiple of the spacing
/// changes a little: derivatives are those of as many samples.
const STRETCH: f64 = 0.05;

/// Parts of a length that are about `spacing` \[m\] at most.
pub(super) fn parts(length: f64, spacing: f64) -> usize {
    (length / spacing - STRETCH).ceil().max(1.0) as usize
}

/// Places \[m\] and the widths \[m\] that they stand for, from `from` to `to`. Next to ends that are marked a row is `strip` away from
/// them, if there is room; between are equal distances of about `spacing` \[m\] at most. Widths are those of the trapezoid rule; marked
/// ends stand for `beyond` more.
pub(super) fn rows<T: Scalar>(
    [from, to]: [T; 2],
    marked: [bool; 2],
    strip: f64,
    spacing: f64,
    beyond: T,
) -> Vec<(T, T)> {
    let length = (to - from).value();
    let margins = marked.iter().filter(|m| **m).count() as f64;
    let inner = length - margins * strip;
    let mut places = vec![from];
    if inner > 0.25 * strip {
        let start = if marked[0] { from.plus(strip) } else { from };
        let end = if marked[1] { to.plus(-strip) } else { to };
        let parts = parts(inner, spacing);
        let between = |i: usize| start + (end - start).times(i as f64 / parts as f64);
        places.extend(marked[0].then_some(start));
        places.extend((1..parts).map(between));
        places.extend(marked[1].then_some(end));
    } else if length > 1.5 * strip {
        places.push((from + to).times(0.5));
    }
    // Of a face as narrow as a strip both ends are close enough.
    places.push(to);
    let last = places.len() - 1;
    let width = |i: usize| {
        let mut width = (places[(i + 1).min(last)] - places[i.saturating_sub(1)]).times(0.5);
        if (i == 0 && marked[0]) || (i == last && marked[1]) {
            width += beyond;
        }
        width
    };
    (0..=last).map(|i| (places[i], width(i))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_stand_for_the_whole_length() {
        for (length, strip, spacing) in [
            (1.0, 0.25, 0.25),
            (1.0, 0.1, 0.25),
            (0.1, 0.1, 0.1),
            (0.2, 0.1, 0.1),
            (0.17, 0.1, 0.1),
        ] {
            let rows = rows([-0.5 * length, 0.5 * length], [true; 2], strip, spacing, 0.01);
            let sum: f64 = rows.iter().map(|(_, width)| width).sum();
            let moment: f64 = rows.iter().map(|(place, width)| place * width).sum();
            assert!((sum - length - 0.02).abs() < 1e-14 && moment.abs() < 1e-14);
            assert!(rows.windows(2).all(|pair| pair[1].0 > pair[0].0 + 1e-9));
            assert!(rows.windows(2).all(|pair| pair[1].0 < pair[0].0 + 1.01 * spacing.max(strip)));
            if length > 0.19 {
                assert!((rows[0].1 - 0.5 * strip - 0.01).abs() < 1e-14, "{rows:?}");
            }
        }
    }
}
