//! Regions of an image: how far its pixels are the object's, by colors and masks.

mod border;
mod colors;
mod settings;

use std::ops::Range;

use nalgebra::Vector2;
use prehend_render::{Mask, RgbImage};

use self::border::MOST_GROWTH;
pub(crate) use self::border::{MaskBorder, pixel_distances};
pub(crate) use self::colors::{ColorRatios, RegionColors, color_index};
pub use self::settings::ForegroundSettings;
use super::MASK_MARGIN;

/// Log-likelihood ratios of object and others at each pixel of an image, and of a border of the object \[nat\], within a window of it.
#[derive(Clone, Debug)]
pub(crate) struct RegionEvidence {
    /// Columns and rows of the image, and of the window.
    size: [usize; 2],
    window: [Range<usize>; 2],
    values: Vec<f32>,
    edges: Vec<f32>,
    /// The value outside of the window, and that of an edge.
    outside: f32,
    no_edge: f32,
    mask_limit: f32,
}

impl RegionEvidence {
    /// From `mask`, and from how often colors of `color`, if there is any, occur within and around it. None of an empty mask.
    pub(crate) fn of_mask(
        color: Option<&RgbImage>,
        mask: &Mask,
        settings: &ForegroundSettings,
    ) -> Option<Self> {
        let border = MaskBorder::new(mask)?;
        let window = border.window();
        let (told, edges) = match color {
            Some(color) => {
                let mut colors = RegionColors::default();
                // At the border colors are mixed, and are no more one's than the other's.
                colors.learn(color, &border, MASK_MARGIN as f32, |_| true, 1.0);
                let ratios = colors.ratios(settings.color_limit, settings.unseen);
                let told = border.pixels().map(|(at, _)| ratios.of(&color.pixels()[at]));
                (told.collect(), edges(color, &window, settings))
            }
            None => {
                let nothing = vec![0.0_f32; border.pixels().count()];
                (nothing.clone(), nothing)
            }
        };
        let growth = border.growth(&told, &edges, settings);
        let sigma = settings.border_sigma as f32;
        let within = |distance: f32| {
            let growths = growth.iter().zip(-(MOST_GROWTH as i32)..);
            let inside = |growth: i32| (distance - growth as f32) / sigma;
            growths.map(|(p, growth)| p * inside(growth).clamp(-1.0, 1.0)).sum::<f32>()
        };
        let pixels = border.pixels().zip(&told);
        let [mask_limit, color_limit] =
            [settings.mask_limit, settings.color_limit].map(|limit| limit as f32);
        let values = pixels.map(|((_, distance), told)| told + mask_limit * within(distance));
        let values = values.collect();
        // What is far away is not the object.
        let outside = -mask_limit - color_limit;
        let (size, no_edge) = ([mask.width(), mask.height()], no_edge(settings));
        Some(Self { size, window, values, edges, outside, no_edge, mask_limit })
    }

    /// From `color` alone, within a window of the image.
    pub(crate) fn of_colors(
        color: &RgbImage,
        window: [Range<usize>; 2],
        ratios: &ColorRatios,
        settings: &ForegroundSettings,
    ) -> Self {
        let [columns, rows] = &window;
        let line = |y: usize| &color.pixels()[y * color.width()..][columns.clone()];
        let values = rows.clone().flat_map(line).map(|pixel| ratios.of(pixel)).collect();
        let size = [color.width(), color.height()];
        let edges = edges(color, &window, settings);
        let (outside, no_edge) = (-ratios.limit(), no_edge(settings));
        let mask_limit = settings.mask_limit as f32;
        Self { size, window, values, edges, outside, no_edge, mask_limit }
    }

    /// Adds that pixels within `border`, which is known within `sigma` \[px\], are the object's and others are not, by `most` at most where they are \[nat\].
    pub(crate) fn add_border(&mut self, border: &MaskBorder, sigma: f32, most: f32) {
        let width = self.size[0];
        let [columns, rows] = self.window.clone();
        for (at, distance) in border.pixels() {
            let (x, y) = (at % width, at / width);
            if columns.contains(&x) && rows.contains(&y) {
                let told = self.mask_limit * (distance / sigma).clamp(-1.0, 1.0);
                self.values[(y - rows.start) * columns.len() + x - columns.start] += told.min(most);
            }
        }
    }

    /// Means of blocks of `factor` pixels across.
    pub(crate) fn reduced(&self, factor: usize) -> Self {
        if factor <= 1 {
            return self.clone();
        }
        let size = self.size.map(|size| (size / factor).max(1));
        let window: [Range<usize>; 2] = std::array::from_fn(|k| {
            let Range { start, end } = &self.window[k];
            start / factor..end.div_ceil(factor).min(size[k])
        });
        let mean = |x: usize, y: usize, of: &[f32], outside: f32| {
            let rows = y * factor..((y + 1) * factor).min(self.size[1]);
            let columns = x * factor..((x + 1) * factor).min(self.size[0]);
            let count = rows.len() * columns.len();
            let sum: f32 = rows
                .flat_map(|y| columns.clone().map(move |x| (x, y)))
                .map(|(x, y)| self.get(x, y, of, outside))
                .sum();
            sum / count as f32
        };
        let [columns, rows] = window.clone();
        let places = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
        let values = places.clone().map(|(x, y)| mean(x, y, &self.values, self.outside)).collect();
        let edges = places.map(|(x, y)| mean(x, y, &self.edges, self.no_edge)).collect();
        Self { size, window, values, edges, ..*self }
    }

    /// Value of an image of the window at a column and row, and `outside` elsewhere.
    fn get(&self, x: usize, y: usize, of: &[f32], outside: f32) -> f32 {
        let [columns, rows] = &self.window;
        if columns.contains(&x) && rows.contains(&y) {
            of[(y - rows.start) * columns.len() + x - columns.start]
        } else {
            outside
        }
    }

    /// Log-likelihood ratio of object and others at a place of the image \[nat\].
    pub(crate) fn at(&self, place: &Vector2<f64>) -> f64 {
        self.sample(place, &self.values, self.outside)
    }

    /// Log-likelihood ratio of a border of the object at a place of the image \[nat\].
    pub(crate) fn edge_at(&self, place: &Vector2<f64>) -> f64 {
        self.sample(place, &self.edges, self.no_edge)
    }

    /// Value of an image of the window at a place, linear between pixels; that of the image's border beyond it.
    fn sample(&self, place: &Vector2<f64>, of: &[f32], outside: f32) -> f64 {
        let [width, height] = self.size;
        let inside = |v: f64, size: usize| v.clamp(0.0, (size - 1) as f64);
        let (x, y) = (inside(place.x, width), inside(place.y, height));
        let (column, row) = (x as usize, y as usize);
        let (right, below) = ((column + 1).min(width - 1), (row + 1).min(height - 1));
        let (s, t) = (x - column as f64, y - row as f64);
        let value = |x: usize, y: usize| f64::from(self.get(x, y, of, outside));
        (1.0 - t) * ((1.0 - s) * value(column, row) + s * value(right, row))
            + t * ((1.0 - s) * value(column, below) + s * value(right, below))
    }
}

/// Log-likelihood ratio of a border at the pixels of a window: borders are where colors change, in proportion to how much \[nat\].
fn edges(color: &RgbImage, window: &[Range<usize>; 2], settings: &ForegroundSettings) -> Vec<f32> {
    let (width, height, pixels) = (color.width(), color.height(), color.pixels());
    let [columns, rows] = window.clone();
    let change = |(x, y): (usize, usize)| {
        let squared = |from: usize, to: usize| -> f32 {
            pixels[from].iter().zip(&pixels[to]).map(|(a, b)| (a - b).powi(2)).sum()
        };
        let (line, left, right) = (y * width, x.saturating_sub(1), (x + 1).min(width - 1));
        let (above, below) = (y.saturating_sub(1), (y + 1).min(height - 1));
        (squared(line + left, line + right) + squared(above * width + x, below * width + x)).sqrt()
    };
    let places = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
    let mut changes: Vec<f32> = places.map(change).collect();
    let mean = changes.iter().sum::<f32>() / changes.len().max(1) as f32;
    let mean = mean.max(f32::MIN_POSITIVE);
    let least = settings.least_contrast as f32;
    changes.iter_mut().for_each(|change| *change = (least + *change / mean).ln());
    changes
}

/// Log-likelihood ratio of a border where no color changes \[nat\].
fn no_edge(settings: &ForegroundSettings) -> f32 {
    (settings.least_contrast as f32).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_part_of_an_image() {
        let color = RgbImage::filled(40, 30, [0.5; 3]);
        let mut colors = RegionColors::default();
        colors.object.learn([color_index(&[0.5; 3])].into_iter(), 1.0);
        colors.others.learn([0].into_iter(), 1.0);
        let settings = ForegroundSettings::default();
        let ratios = colors.ratios(1.0, settings.unseen);
        let evidence = RegionEvidence::of_colors(&color, [10..30, 5..25], &ratios, &settings);
        for (factor, evidence) in [(1.0, evidence.clone()), (2.0, evidence.reduced(2))] {
            let at = |x: f64, y: f64| evidence.at(&Vector2::new(x / factor, y / factor));
            assert!((at(20.0, 15.0) - 1.0).abs() < 1e-6);
            assert!((at(3.0, 15.0) + 1.0).abs() < 1e-6);
            assert!((at(-3.0, 400.0) + 1.0).abs() < 1e-6);
        }
    }
}
