//! Images.

use std::path::Path;

use prehend_render::{DepthImage, ImageError, Mask, RgbImage};
use serde_json::{Value, json};

use crate::data::AssetError;
use crate::data::bop::DatasetError;

/// Size, and `pixels`: `color` with the mean of each channel (0 to 1); `depth`, 16-bit gray, with the number of pixels that are not zero and the range
/// of those in units of the file; `gray` with the number of pixels that are not zero and their bounds (left, top, width, height).
pub(super) fn read(path: &Path) -> Result<Value, AssetError> {
    match DepthImage::load(path, 1.0) {
        Ok(depth) => {
            let valid: Vec<f32> = depth.pixels().iter().copied().filter(|z| *z > 0.0).collect();
            let least = valid.iter().copied().reduce(f32::min);
            let range = least.zip(valid.iter().copied().reduce(f32::max)).map(<[f32; 2]>::from);
            Ok(json!({
                "width": depth.width(), "height": depth.height(), "pixels": "depth", "valid": valid.len(), "range": range,
            }))
        }
        // `L8` or `La8`: luminance.
        Err(ImageError::Kind { found, .. }) if found.starts_with('L') => {
            let mask = Mask::load(path).map_err(DatasetError::from)?;
            Ok(json!({
                "width": mask.width(), "height": mask.height(), "pixels": "gray", "set": mask.count(), "bounds": mask.bounds(),
            }))
        }
        Err(ImageError::Kind { .. }) => {
            let color = RgbImage::load(path).map_err(DatasetError::from)?;
            let channel = |k: usize| {
                let sum = color.pixels().iter().map(|pixel| f64::from(pixel[k])).sum::<f64>();
                sum / color.pixels().len() as f64
            };
            let mean = [0, 1, 2].map(channel);
            Ok(json!({
                "width": color.width(), "height": color.height(), "pixels": "color", "mean": mean,
            }))
        }
        Err(error) => Err(DatasetError::from(error).into()),
    }
}
