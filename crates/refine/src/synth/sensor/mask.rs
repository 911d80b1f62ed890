//! A segmentation that is nearly right.

use prehend_geometry::SplitMix64;
use prehend_render::Mask;

use super::settings::MaskSettings;
use super::smooth_field::smooth_field;

impl MaskSettings {
    /// Segmentation of an object that is `visible` beside a hand at `hand`.
    pub(super) fn segment(&self, visible: &Mask, hand: &Mask, noise: &mut SplitMix64) -> Mask {
        let mut mask = visible.clone();
        if self.wobble <= 0.0 && self.leak <= 0.0 {
            return mask;
        }
        let (width, height) = (visible.width(), visible.height());
        let wobble = smooth_field(width, height, self.wobble_length / 2.0, noise);
        let leaks = smooth_field(width, height, 10.0, noise);
        // A normal number exceeds this with the probability `leak_share` (logistic approximation, good to 0.02).
        let share = self.leak_share.clamp(1e-6, 1.0 - 1e-6);
        let limit = (-(share / (1.0 - share)).ln() / 1.702) as f32;
        let reach = (4.0 * self.wobble + self.leak).ceil() as usize + 1;
        let outside = distance_to(visible, true, reach);
        let inside = distance_to(visible, false, reach);
        for (i, set) in mask.pixels_mut().iter_mut().enumerate() {
            // The outline runs half a pixel from the centers beside it.
            let signed = if *set { 0.5 - inside[i] } else { outside[i] - 0.5 };
            let mut border = self.wobble as f32 * wobble[i];
            if hand.pixels()[i] && leaks[i] > limit {
                border += self.leak as f32 * ((leaks[i] - limit) / 0.5).min(1.0);
            }
            *set = signed < border;
        }
        mask
    }
}

/// Distance of each pixel's center from that of the nearest one whose value is `value` \[px\], `reach` + 1 where there is
/// none within `reach` columns and rows. Exact: rows first, then columns (Saito and Toriwaki, 1994).
fn distance_to(mask: &Mask, value: bool, reach: usize) -> Vec<f32> {
    let (width, height) = (mask.width(), mask.height());
    let far = reach + 1;
    let mut along = vec![far; width * height];
    for (row, out) in mask.pixels().chunks(width.max(1)).zip(along.chunks_mut(width.max(1))) {
        let mut last = far;
        for (set, d) in row.iter().zip(out.iter_mut()) {
            last = if *set == value { 0 } else { (last + 1).min(far) };
            *d = last;
        }
        let mut last = far;
        for (set, d) in row.iter().zip(out.iter_mut()).rev() {
            last = if *set == value { 0 } else { (last + 1).min(far) };
            *d = (*d).min(last);
        }
    }
    let mut distance = vec![far as f32; width * height];
    for y in 0..height {
        let rows = y.saturating_sub(reach)..(y + far).min(height);
        for x in 0..width {
            let squared = |other: usize| {
                let d = along[other * width + x];
                (d < far).then(|| d * d + other.abs_diff(y).pow(2))
            };
            if along[y * width + x] == 0 {
                distance[y * width + x] = 0.0;
            } else if let Some(least) = rows.clone().filter_map(squared).min() {
                distance[y * width + x] = (least as f32).sqrt();
            }
        }
    }
    distance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::sensor::settings::SensorSettings;

    /// A square of 60 × 60 with a hand over its right border.
    fn square() -> (Mask, Mask) {
        let (mut object, mut hand) = (Mask::filled(160, 120, false), Mask::filled(160, 120, false));
        for y in 30..90 {
            object.pixels_mut()[y * 160 + 40..y * 160 + 100].fill(true);
            hand.pixels_mut()[y * 160 + 100..y * 160 + 140].fill(true);
        }
        (object, hand)
    }

    #[test]
    fn distances_are_exact() {
        let (object, _) = square();
        let distance = distance_to(&object, true, 9);
        for (i, d) in distance.iter().enumerate() {
            let (x, y) = ((i % 160) as f32, (i / 160) as f32);
            let over = |v: f32, low: f32, high: f32| (low - v).max(v - high).max(0.0);
            let (dx, dy) = (over(x, 40.0, 99.0), over(y, 30.0, 89.0));
            if dx <= 9.0 && dy <= 9.0 {
                assert!((d - dx.hypot(dy)).abs() < 1e-4, "{x} {y}: {d}");
            } else {
                assert!(*d >= 9.9, "{x} {y}: {d}");
            }
        }
    }

    #[test]
    fn outlines_wobble_by_as_much_as_asked_for() {
        let (object, hand) = square();
        let mut noise = SplitMix64::new(9);
        assert_eq!(SensorSettings::clean().mask.segment(&object, &hand, &mut noise), object);
        let settings = MaskSettings { wobble: 2.0, leak: 0.0, ..SensorSettings::realistic().mask };
        let mut square_sum = 0.0;
        let mut rows = 0.0;
        for _ in 0..20 {
            let mask = settings.segment(&object, &hand, &mut noise);
            for y in 40..80 {
                let first = (0..80).find(|x| mask.pixels()[y * 160 + x]).unwrap_or(80);
                square_sum += (first as f64 - 40.0).powi(2);
                rows += 1.0;
            }
        }
        let spread: f64 = square_sum / rows;
        assert!((1.4..2.8).contains(&spread.sqrt()), "{}", spread.sqrt());
    }

    #[test]
    fn leaks_go_onto_the_hand_only() {
        let (object, hand) = square();
        let settings =
            MaskSettings { wobble: 0.0, leak_share: 0.5, ..SensorSettings::realistic().mask };
        let mask = settings.segment(&object, &hand, &mut SplitMix64::new(10));
        let added = |onto: &Mask| {
            let all = mask.pixels().iter().zip(object.pixels()).zip(onto.pixels());
            all.filter(|((now, before), here)| **now && !**before && **here).count()
        };
        let total = mask.count() - object.count();
        assert!(total > 20 && added(&hand) == total, "{total} {}", added(&hand));
    }
}
