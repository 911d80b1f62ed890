//! Something in front of the object.

use prehend_geometry::SplitMix64;

use crate::scene::Frame;

/// How far in front of the object the block is \[m\].
const AHEAD: f64 = 0.03;

/// A gray block with a straight edge in front of the object, from one side, that leaves `visible` of the mask's pixels to be seen:
/// it is in the depth and the color image, and the mask knows of it.
pub(super) fn block(observation: &mut Frame, visible: f64, random: &mut SplitMix64) {
    let width = observation.camera.width;
    let angle = std::f64::consts::TAU * random.uniform();
    let (across, down) = (angle.cos(), angle.sin());
    let along = |k: usize| across * (k % width) as f64 + down * (k / width) as f64;
    let mask = observation.mask.pixels();
    let mut object: Vec<usize> = (0..mask.len()).filter(|&k| mask[k]).collect();
    object.sort_by(|&a, &b| along(a).total_cmp(&along(b)));
    let kept = (visible * object.len() as f64).round() as usize;
    let Some(&edge) = object.get(kept) else { return };
    let edge = along(edge);
    let depths = object.iter().map(|&k| observation.depth.pixels()[k]).filter(|&z| z > 0.0);
    let nearest = depths.fold(f32::INFINITY, f32::min);
    let front = if nearest.is_finite() { (f64::from(nearest) - AHEAD).max(0.1) } else { 0.0 };
    // The block is a little larger than what is to be hidden of the object.
    let Some([left, top, columns, rows]) = observation.mask.bounds() else { return };
    let margin = (columns.max(rows) - 1) / 10 + 1;
    let within = |v: usize, low: usize, size: usize| v + margin >= low && v < low + size + margin;
    for k in 0..observation.depth.pixels().len() {
        if along(k) >= edge && within(k % width, left, columns) && within(k / width, top, rows) {
            observation.mask.pixels_mut()[k] = false;
            observation.depth.pixels_mut()[k] = front as f32;
            observation.color.pixels_mut()[k] = [0.5; 3];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::square;
    use super::*;

    #[test]
    fn as_much_is_left_as_was_asked_for_and_the_rest_is_behind_something() {
        for visible in [0.75, 0.5, 0.1] {
            for seed in 0..4 {
                let (whole, mut hidden) = (square(), square());
                block(&mut hidden, visible, &mut SplitMix64::new(seed));
                let left = hidden.mask.count() as f64 / whole.mask.count() as f64;
                // Pixels at the same distance go together.
                assert!(left <= visible + 1e-9 && left > visible - 0.051, "{visible} {left}");
                for (k, (&was, &is)) in
                    whole.mask.pixels().iter().zip(hidden.mask.pixels()).enumerate()
                {
                    assert!(was || !is);
                    let z = hidden.depth.pixels()[k];
                    assert_eq!(was && !is, was && (z - 0.47).abs() < 1e-6);
                }
            }
        }
    }

    #[test]
    fn nothing_is_hidden_of_nothing() {
        let mut empty = square();
        empty.mask.pixels_mut().fill(false);
        let before = empty.depth.clone();
        block(&mut empty, 0.5, &mut SplitMix64::new(0));
        assert_eq!(empty.depth, before);
    }
}
