//! The border of a mask.

use std::f32::consts::SQRT_2;
use std::ops::Range;

use prehend_render::Mask;

use super::ForegroundSettings;

/// By how much a mask is shrunk or grown everywhere at most \[px\]: the length of arrays.
pub(super) const MOST_GROWTH: usize = 4;

/// Distances to the border of a mask, of the pixels about it.
pub(crate) struct MaskBorder {
    /// Columns of the image.
    width: usize,
    left: usize,
    top: usize,
    columns: usize,
    /// Positive inside \[px\].
    distances: Vec<f32>,
}

impl MaskBorder {
    /// Border of `mask`, with as much of what is around the object as it is large; none of an empty mask. Chamfer distances (Borgefors, 1986) of pixel
    /// centers to the border, which is between pixels.
    pub(super) fn new(mask: &Mask) -> Option<Self> {
        let (width, [left, top, columns, rows]) = (mask.width(), mask.bounds()?);
        let around = columns.max(rows) / 2 + 1;
        let (right, bottom) = (left + columns + around, top + rows + around);
        let (left, top) = (left.saturating_sub(around), top.saturating_sub(around));
        Some(Self::of_window(mask, [left..right.min(width), top..bottom.min(mask.height())]))
    }

    /// Border of `mask` in a window of its image.
    pub(crate) fn of_window(mask: &Mask, window: [Range<usize>; 2]) -> Self {
        let (width, [columns, rows]) = (mask.width(), window.clone());
        let line = |y: usize| &mask.pixels()[y * width..][columns.clone()];
        let set: Vec<bool> = rows.flat_map(line).copied().collect();
        Self::within(width, window, &set)
    }

    /// Border of what is `set` of a window of an image that is `width` columns wide.
    pub(crate) fn within(width: usize, window: [Range<usize>; 2], set: &[bool]) -> Self {
        let [Range { start: left, end: right }, Range { start: top, .. }] = window;
        let columns = right - left;
        let outside = pixel_distances(set, columns, true);
        let inside = pixel_distances(set, columns, false);
        let signed = |(out, into): (&f32, &f32)| if *into > 0.0 { into - 0.5 } else { 0.5 - out };
        let distances = outside.iter().zip(&inside).map(signed).collect();
        Self { width, left, top, columns, distances }
    }

    /// Its columns and rows of the image.
    pub(super) fn window(&self) -> [Range<usize>; 2] {
        let rows = self.distances.len() / self.columns;
        [self.left..self.left + self.columns, self.top..self.top + rows]
    }

    /// The index of each pixel in the image, and its distance to the border \[px\].
    pub(crate) fn pixels(&self) -> impl Iterator<Item = (usize, f32)> + Clone {
        let index =
            |k: usize| (self.top + k / self.columns) * self.width + self.left + k % self.columns;
        self.distances.iter().enumerate().map(move |(k, distance)| (index(k), *distance))
    }

    /// Probability of each whole number of pixels from −[`MOST_GROWTH`] on that the mask is grown by everywhere; of its pixels, `colors` are the log-likelihood
    /// ratios of object and others, and `edges` those of a border \[nat\]. The prior of growth is a Cauchy distribution.
    pub(super) fn growth(
        &self,
        colors: &[f32],
        edges: &[f32],
        settings: &ForegroundSettings,
    ) -> [f32; 2 * MOST_GROWTH + 1] {
        let [samples, typical] = [settings.effective_samples, settings.growth].map(|v| v as f32);
        // Sums of the pixels at about one distance: number, evidence of edges, of colors.
        let mut levels = [[0.0_f32; 3]; 2 * MOST_GROWTH + 2];
        for (distance, (color, edge)) in self.distances.iter().zip(colors.iter().zip(edges)) {
            let level = (distance.floor() as i32).saturating_add(MOST_GROWTH as i32 + 1);
            let level = usize::try_from(level).ok().and_then(|level| levels.get_mut(level));
            let Some(level) = level else { continue };
            level.iter_mut().zip([1.0, *edge, *color]).for_each(|(sum, value)| *sum += value);
        }
        let mean = |sum: usize| levels.map(|level| level[sum] / level[0].max(1.0));
        let (edges, colors) = (mean(1), mean(2));
        let log_likelihood = |k: usize| {
            let growth = k as f32 - MOST_GROWTH as f32;
            let inside: f32 = colors[k + 1..].iter().sum();
            let edge = 0.5 * (edges[k] + edges[k + 1]);
            samples * (inside + edge) - (growth / typical).powi(2).ln_1p()
        };
        let logs: [f32; 2 * MOST_GROWTH + 1] = std::array::from_fn(log_likelihood);
        let largest = logs.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let likelihoods = logs.map(|log| (log - largest).exp());
        let sum: f32 = likelihoods.iter().sum();
        likelihoods.map(|likelihood| likelihood / sum)
    }
}

/// Distance of each pixel of an image of `columns` columns to the nearest one that is `to` \[px\].
pub(crate) fn pixel_distances(set: &[bool], columns: usize, to: bool) -> Vec<f32> {
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
    use prehend_render::RgbImage;

    use super::super::{RegionColors, edges};
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
        for growth in [-3.0, -2.0, 0.0, 2.0, 3.0] {
            let border = MaskBorder::new(&disk(15.0 + growth).0).unwrap();
            let mut colors = RegionColors::default();
            colors.learn(&picture, &border, 4.0, |_| true, 1.0);
            let settings = ForegroundSettings::default();
            let ratios = colors.ratios(1.0, settings.unseen);
            let told: Vec<f32> =
                border.pixels().map(|(at, _)| ratios.of(&picture.pixels()[at])).collect();
            let edges = edges(&picture, &border.window(), &settings);
            let found = border.growth(&told, &edges, &settings);
            let steps = -(MOST_GROWTH as i32)..;
            let mean: f64 =
                found.iter().zip(steps).map(|(p, g)| f64::from(*p) * f64::from(g)).sum();
            assert!((mean - growth).abs() <= 0.6, "{growth}: {mean}");
        }
        // Without any evidence it is the prior.
        let border = MaskBorder::new(&disk(15.0).0).unwrap();
        let nothing = vec![0.0; border.distances.len()];
        let found = border.growth(&nothing, &nothing, &ForegroundSettings::default());
        assert!(found[MOST_GROWTH] > 0.4 && found[0] > 1e-3, "{found:?}");
    }
}
