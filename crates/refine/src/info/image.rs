//! Images.

use std::fmt;
use std::path::Path;

use prehend_render::{DepthImage, ImageError, Mask, RgbImage};
use serde::Serialize;

use super::InfoError;
use super::lines::line;

/// An image.
#[derive(Clone, Debug, Serialize)]
pub struct ImageInfo {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// What can be in it.
    #[serde(flatten)]
    pub content: ImageKind,
}

/// What an image can be by its pixels.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "pixels", rename_all = "lowercase")]
pub enum ImageKind {
    /// Color.
    Color {
        /// Mean of each channel, 0 to 1.
        mean: [f64; 3],
    },
    /// 16-bit gray, as depth images are.
    Depth {
        /// Pixels that are not zero.
        valid: usize,
        /// The smallest of those and the largest, in units of the file.
        range: Option<[f32; 2]>,
    },
    /// Gray, as masks are.
    Gray {
        /// Pixels that are not zero.
        set: usize,
        /// Left, top, width and height of the smallest rectangle around those.
        bounds: Option<[usize; 4]>,
    },
}

impl ImageInfo {
    pub(super) fn read(path: &Path) -> Result<Self, InfoError> {
        match DepthImage::load(path, 1.0) {
            Ok(depth) => Ok(Self::depth(&depth)),
            // `L8` or `La8`: luminance.
            Err(ImageError::Kind { found, .. }) if found.starts_with('L') => {
                let mask = Mask::load(path)?;
                let content = ImageKind::Gray { set: mask.count(), bounds: mask.bounds() };
                Ok(Self { width: mask.width(), height: mask.height(), content })
            }
            Err(ImageError::Kind { .. }) => {
                let color = RgbImage::load(path)?;
                let count = color.pixels().len() as f64;
                let channel = |k: usize| {
                    color.pixels().iter().map(|pixel| f64::from(pixel[k])).sum::<f64>() / count
                };
                let content = ImageKind::Color { mean: [0, 1, 2].map(channel) };
                Ok(Self { width: color.width(), height: color.height(), content })
            }
            Err(error) => Err(error.into()),
        }
    }

    fn depth(depth: &DepthImage) -> Self {
        let valid: Vec<f32> = depth.pixels().iter().copied().filter(|z| *z > 0.0).collect();
        let least = valid.iter().copied().reduce(f32::min);
        let range = least.zip(valid.iter().copied().reduce(f32::max)).map(<[f32; 2]>::from);
        let content = ImageKind::Depth { valid: valid.len(), range };
        Self { width: depth.width(), height: depth.height(), content }
    }
}

impl fmt::Display for ImageInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        line(f, "size", format!("{}x{} pixels", self.width, self.height))?;
        let share = |count: usize| 100.0 * count as f64 / (self.width * self.height) as f64;
        match &self.content {
            ImageKind::Color { mean: [r, g, b] } => {
                line(f, "pixels", format!("color, {r:.2} {g:.2} {b:.2} on average"))
            }
            ImageKind::Depth { valid, range } => {
                let range = match range {
                    Some([low, high]) => format!("from {low} to {high} units"),
                    None => "no measurement".to_owned(),
                };
                line(f, "pixels", format!("16-bit gray, {:.1} % not zero, {range}", share(*valid)))
            }
            ImageKind::Gray { set, bounds } => {
                let bounds = match bounds {
                    Some([x, y, w, h]) => format!("within {w}x{h} pixels from column {x}, row {y}"),
                    None => "empty".to_owned(),
                };
                line(f, "pixels", format!("gray, {:.1} % not zero, {bounds}", share(*set)))
            }
        }
    }
}
