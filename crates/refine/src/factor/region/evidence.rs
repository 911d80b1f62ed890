//! What the pixels of an image say of where the object is.

use prehend_render::{Mask, RgbImage};

use super::border::MaskBorder;
use super::colors::{ColorHistogram, LEVELS, color_index};
use crate::scene::MASK_MARGIN;

/// Largest evidence of a pixel's color \[nat\].
const COLOR_LIMIT: f32 = 1.0;
/// Largest evidence of the mask \[nat\].
const MASK_LIMIT: f32 = 3.0;

/// Log-likelihood ratio of object and others at each pixel of an image \[nat\].
pub(super) struct RegionEvidence {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl RegionEvidence {
    /// From `mask`, and from how often colors of `color`, if there is any, occur within and around it; `factor` times smaller. None of an empty mask.
    pub(super) fn new(color: Option<&RgbImage>, mask: &Mask, factor: usize) -> Option<Self> {
        let border = MaskBorder::new(mask)?;
        let color = color.map(|color| (color, color_ratios(color, &border)));
        let growth = color.as_ref().map(|(color, ratios)| border.growth(color, ratios));
        let (width, height) = (mask.width(), mask.height());
        // What is far away is not the object.
        let mut values = vec![-MASK_LIMIT - COLOR_LIMIT; width * height];
        for (at, inside) in border.pixels() {
            let inside = (inside - growth.unwrap_or_default()) / MaskBorder::SIGMA;
            let ratio = |(color, ratios): &(&RgbImage, Vec<f32>)| {
                ratios[usize::from(color_index(&color.pixels()[at]))]
            };
            let told = color.as_ref().map_or(0.0, ratio);
            values[at] = told + MASK_LIMIT * inside.clamp(-1.0, 1.0);
        }
        Some(Self { width, height, values }.reduced(factor))
    }

    /// Means of blocks of `factor` pixels across.
    fn reduced(self, factor: usize) -> Self {
        if factor <= 1 {
            return self;
        }
        let (width, height) = ((self.width / factor).max(1), (self.height / factor).max(1));
        let mut values = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let mut sum = 0.0;
                for row in y * factor..((y + 1) * factor).min(self.height) {
                    let from = row * self.width + x * factor;
                    sum += self.values[from..from + factor.min(self.width - x * factor)]
                        .iter()
                        .sum::<f32>();
                }
                values.push(sum / (factor * factor) as f32);
            }
        }
        Self { width, height, values }
    }

    /// The value at a place of the image, linear between pixels; of its border beyond it.
    pub(super) fn at(&self, x: f64, y: f64) -> f64 {
        let inside = |v: f64, size: usize| v.clamp(0.0, (size - 1) as f64);
        let (x, y) = (inside(x, self.width), inside(y, self.height));
        let (column, row) = (x as usize, y as usize);
        let (right, below) = ((column + 1).min(self.width - 1), (row + 1).min(self.height - 1));
        let (s, t) = (x - column as f64, y - row as f64);
        let value = |x: usize, y: usize| f64::from(self.values[y * self.width + x]);
        (1.0 - t) * ((1.0 - s) * value(column, row) + s * value(right, row))
            + t * ((1.0 - s) * value(column, below) + s * value(right, below))
    }
}

/// Log-likelihood ratio of each color \[nat\]; zero without pixels to learn from. At the border colors are mixed, and are no more one's than the other's.
fn color_ratios(color: &RgbImage, border: &MaskBorder) -> Vec<f32> {
    let learnt = |sign: f32| {
        let mut histogram = ColorHistogram::default();
        let own = border.pixels().filter(|(_, inside)| sign * inside > MASK_MARGIN as f32);
        histogram.learn(own.map(|(at, _)| color_index(&color.pixels()[at])), 1.0);
        histogram
    };
    let (own, others) = (learnt(1.0), learnt(-1.0));
    if !(own.is_known() && others.is_known()) {
        return vec![0.0; usize::from(LEVELS).pow(3)];
    }
    own.log_ratios(&others, COLOR_LIMIT).collect()
}
