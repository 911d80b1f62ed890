//! The border of a mask.

use std::f32::consts::SQRT_2;

use prehend_render::{Mask, RgbImage};

use super::colors::color_index;

/// By how much a mask is shrunk or grown everywhere at most \[px\].
const MOST_GROWTH: usize = 5;
/// How far from where colors change on the whole the image's edges are looked for \[px\].
const EDGE_REACH: f32 = 2.0;
/// How many times as strong as those along the mask's border edges must be for the border to be elsewhere.
const EDGE_RATIO: f32 = 1.25;

/// Distances to the border of a mask, of the pixels about it.
pub(super) struct MaskBorder {
    /// Columns of the image.
    width: usize,
    left: usize,
    top: usize,
    columns: usize,
    /// Positive inside \[px\].
    distances: Vec<f32>,
}

impl MaskBorder {
    /// Standard deviation of a border that is drawn with care \[px\].
    pub(super) const SIGMA: f32 = 1.5;

    /// Border of `mask`, with as much of what is around the object as it is large; none of an empty mask. Chamfer distances (Borgefors, 1986) of pixel
    /// centers to the border, which is between pixels.
    pub(super) fn new(mask: &Mask) -> Option<Self> {
        let (width, [left, top, columns, rows]) = (mask.width(), mask.bounds()?);
        let around = columns.max(rows) / 2 + 1;
        let (right, bottom) = (left + columns + around, top + rows + around);
        let (left, top) = (left.saturating_sub(around), top.saturating_sub(around));
        let (columns, rows) = (right.min(width) - left, bottom.min(mask.height()) - top);
        let line = |y: usize| {
            let from = (top + y) * width + left;
            &mask.pixels()[from..from + columns]
        };
        let set: Vec<bool> = (0..rows).flat_map(line).copied().collect();
        let outside = chamfer(&set, columns, true);
        let inside = chamfer(&set, columns, false);
        let signed = |(out, into): (&f32, &f32)| if *into > 0.0 { into - 0.5 } else { 0.5 - out };
        let distances = outside.iter().zip(&inside).map(signed).collect();
        Some(Self { width, left, top, columns, distances })
    }

    /// The index of each pixel in the image, and its distance to the border \[px\].
    pub(super) fn pixels(&self) -> impl Iterator<Item = (usize, f32)> + Clone {
        let index =
            |k: usize| (self.top + k / self.columns) * self.width + self.left + k % self.columns;
        self.distances.iter().enumerate().map(move |(k, distance)| (index(k), *distance))
    }

    /// How far outside the image's own edges the border is everywhere \[px\]; `ratios` are what each color tells of object and others.
    ///
    /// Nothing unless edges are clearly stronger elsewhere, and farther away than a border may be: where an edge is to a pixel, light and shadow decide, too.
    pub(super) fn growth(&self, color: &RgbImage, ratios: &[f32]) -> f32 {
        // Of the pixels at about one distance: number, sum of changes of color across the border, sum of what colors tell.
        let mut levels = [[0.0_f32; 3]; 2 * MOST_GROWTH];
        let (pixels, rows) = (color.pixels(), self.distances.len() / self.columns);
        for (k, (at, distance)) in self.pixels().enumerate() {
            let (x, y) = (k % self.columns, k / self.columns);
            let inner = x > 0 && y > 0 && x + 1 < self.columns && y + 1 < rows;
            let level = distance.floor() as i32 + MOST_GROWTH as i32;
            let level = usize::try_from(level).ok().and_then(|level| levels.get_mut(level));
            let Some([count, change, told]) = level.filter(|_| inner) else { continue };
            let slope = |step: usize| 0.5 * (self.distances[k + step] - self.distances[k - step]);
            let (right, down) = (slope(1), slope(self.columns));
            let across = |channel: usize| {
                let change = |step: usize| pixels[at + step][channel] - pixels[at - step][channel];
                0.5 * (right * change(1) + down * change(self.width))
            };
            *count += 1.0;
            *change += [0, 1, 2].map(|channel| across(channel).powi(2)).iter().sum::<f32>().sqrt();
            *told += ratios[usize::from(color_index(&pixels[at]))];
        }
        let mean = |sum: usize| levels.map(|level| level[sum] / level[0].max(1.0));
        let (changes, told) = (mean(1), mean(2));
        let strength = |k: usize| changes[k - 1] + 2.0 * changes[k] + changes[k + 1];
        let crossing = crossing(&told);
        let is_near = |k: &usize| (*k as f32 + 0.5 - crossing).abs() <= EDGE_REACH;
        let inner = (1..levels.len() - 1).filter(is_near);
        let Some(strongest) = inner.max_by(|a, b| strength(*a).total_cmp(&strength(*b))) else {
            return 0.0;
        };
        let around = strongest - 1..=strongest + 1;
        let weight: f32 = around.clone().map(|k| changes[k]).sum();
        let place: f32 = around.map(|k| changes[k] * (k as f32 + 0.5)).sum();
        let growth = place / weight.max(f32::MIN_POSITIVE) - MOST_GROWTH as f32;
        let of_border = strength(MOST_GROWTH).max(strength(MOST_GROWTH - 1));
        let is_elsewhere = strength(strongest) > EDGE_RATIO * of_border;
        if is_elsewhere && growth.abs() > Self::SIGMA { growth } else { 0.0 }
    }
}

/// The level, counted from the farthest outside, from which on inward colors are the object's on the whole.
fn crossing(told: &[f32]) -> f32 {
    let (mut most, mut at, mut sum) = (0.0, told.len(), 0.0);
    for (k, told) in told.iter().enumerate().rev() {
        sum += told;
        if sum > most {
            (most, at) = (sum, k);
        }
    }
    at as f32
}

/// Distance of each pixel of an image of `columns` columns to the nearest one that is `to` \[px\].
fn chamfer(set: &[bool], columns: usize, to: bool) -> Vec<f32> {
    let rows = set.len() / columns;
    let mut distances: Vec<f32> =
        set.iter().map(|set| if *set == to { 0.0 } else { f32::MAX }).collect();
    let mut visit = |x: usize, y: usize, back: isize| {
        let mut least = distances[y * columns + x];
        for (dx, dy, step) in [(1, 0, 1.0), (0, 1, 1.0), (1, 1, SQRT_2), (-1, 1, SQRT_2)] {
            let (x, y) = (x.wrapping_add_signed(back * dx), y.wrapping_add_signed(back * dy));
            if x < columns && y < rows {
                least = least.min(distances[y * columns + x] + step);
            }
        }
        distances[y * columns + x] = least;
    };
    for y in 0..rows {
        (0..columns).for_each(|x| visit(x, y, -1));
    }
    for y in (0..rows).rev() {
        (0..columns).rev().for_each(|x| visit(x, y, 1));
    }
    distances
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disk of `radius` \[px\], and its picture: red before green.
    fn disk(radius: f64) -> (Mask, RgbImage) {
        let inside = |k: usize| {
            let [x, y] = [(k % 80) as f64 - 40.0, (k / 80) as f64 - 30.0];
            x.hypot(y) < radius
        };
        let mask: Vec<bool> = (0..80 * 60).map(inside).collect();
        let color = mask.iter().map(|set| if *set { [0.8, 0.1, 0.1] } else { [0.1, 0.6, 0.1] });
        let color = RgbImage::new(80, 60, color.collect()).unwrap();
        (Mask::new(80, 60, mask).unwrap(), color)
    }

    #[test]
    fn distances_are_to_the_border() {
        let border = MaskBorder::new(&disk(15.0).0).unwrap();
        for (at, distance) in border.pixels() {
            let [x, y] = [(at % 80) as f32 - 40.0, (at / 80) as f32 - 30.0];
            let expected = 15.0 - x.hypot(y);
            assert!(
                (distance - expected).abs() < 1.0 + 0.09 * expected.abs(),
                "{distance} {expected}"
            );
        }
        assert!(MaskBorder::new(&Mask::filled(8, 8, false)).is_none());
    }

    #[test]
    fn masks_that_are_shrunk_or_grown_are_told() {
        let picture = disk(15.0).1;
        let mut ratios = vec![0.0; 4096];
        ratios[usize::from(color_index(&[0.8, 0.1, 0.1]))] = 1.0;
        ratios[usize::from(color_index(&[0.1, 0.6, 0.1]))] = -1.0;
        for growth in [-3.0, -2.0, 0.0, 2.0, 3.0] {
            let border = MaskBorder::new(&disk(15.0 + growth).0).unwrap();
            let found = f64::from(border.growth(&picture, &ratios));
            assert!((found - growth).abs() <= 0.6, "{growth}: {found}");
        }
        let gray = RgbImage::filled(80, 60, [0.5; 3]);
        assert_eq!(MaskBorder::new(&disk(15.0).0).unwrap().growth(&gray, &ratios), 0.0);
    }
}
