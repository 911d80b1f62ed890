//! Decoding of the image files of a frame.

use std::fs;
use std::path::Path;

use image::DynamicImage;

use super::error::DatasetError;

/// A colour image, row-major from the top-left.
#[derive(Clone, Debug, PartialEq)]
pub struct RgbPixels {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green and blue in 0..=1 as stored in the file, `width * height` of them.
    pub data: Vec<[f32; 3]>,
}

/// A depth image, row-major from the top-left.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthPixels {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// z coordinates in the camera frame \[m\], `width * height` of them; 0 where nothing was measured.
    pub data: Vec<f32>,
}

/// A set of pixels, row-major from the top-left.
#[derive(Clone, Debug, PartialEq)]
pub struct MaskPixels {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Whether each pixel belongs to the set, `width * height` of them.
    pub data: Vec<bool>,
}

impl RgbPixels {
    /// Reads a PNG or JPEG file.
    ///
    /// # Errors
    /// When it is absent or does not decode.
    pub fn load(file: &Path) -> Result<Self, DatasetError> {
        let image = decode(file)?.into_rgb8();
        let (width, height) = (image.width() as usize, image.height() as usize);
        Ok(Self {
            width,
            height,
            data: image.pixels().map(|p| p.0.map(|c| f32::from(c) / 255.0)).collect(),
        })
    }
}

impl DepthPixels {
    /// Reads a greyscale PNG file; a stored value times `depth_scale` is millimetres.
    ///
    /// # Errors
    /// When it is absent, does not decode, or has colours.
    pub fn load(file: &Path, depth_scale: f64) -> Result<Self, DatasetError> {
        let image = decode(file)?;
        if !matches!(image, DynamicImage::ImageLuma16(_) | DynamicImage::ImageLuma8(_)) {
            return Err(DatasetError::malformed(file, "a depth image must be greyscale"));
        }
        // Widening 8 bits to 16 would rescale the stored values, which here are numbers, not shades.
        let (width, height) = (image.width() as usize, image.height() as usize);
        let metres = |v: u16| (f64::from(v) * depth_scale / 1000.0) as f32;
        let data = match image {
            DynamicImage::ImageLuma8(i) => {
                i.into_raw().into_iter().map(|v| metres(v.into())).collect()
            }
            other => other.into_luma16().into_raw().into_iter().map(metres).collect(),
        };
        Ok(Self { width, height, data })
    }
}

impl MaskPixels {
    /// Reads an image file; every pixel that is not black belongs to the mask.
    ///
    /// # Errors
    /// When it is absent or does not decode.
    pub fn load(file: &Path) -> Result<Self, DatasetError> {
        let image = decode(file)?;
        let (width, height) = (image.width() as usize, image.height() as usize);
        Ok(Self {
            width,
            height,
            data: image.into_luma16().into_raw().into_iter().map(|v| v > 0).collect(),
        })
    }
}

/// Decodes by content rather than by the file's extension.
fn decode(file: &Path) -> Result<DynamicImage, DatasetError> {
    let bytes = fs::read(file).map_err(|e| DatasetError::reading(file, &e))?;
    image::load_from_memory(&bytes).map_err(|e| DatasetError::malformed(file, e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageBuffer, Luma, Rgb};

    #[test]
    fn decodes_values_as_stored() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        ImageBuffer::<Rgb<u8>, _>::from_raw(2, 1, vec![255u8, 0, 51, 0, 255, 102])
            .unwrap()
            .save(at("c.png"))
            .unwrap();
        ImageBuffer::<Luma<u16>, _>::from_raw(2, 1, vec![0u16, 4375])
            .unwrap()
            .save(at("d.png"))
            .unwrap();
        ImageBuffer::<Luma<u8>, _>::from_raw(2, 1, vec![0u8, 200])
            .unwrap()
            .save(at("d8.png"))
            .unwrap();
        ImageBuffer::<Luma<u8>, _>::from_raw(2, 1, vec![1u8, 0])
            .unwrap()
            .save(at("m.png"))
            .unwrap();
        let rgb = RgbPixels::load(&at("c.png")).unwrap();
        assert_eq!(
            (rgb.width, rgb.height, rgb.data),
            (2, 1, vec![[1.0, 0.0, 0.2], [0.0, 1.0, 0.4]])
        );
        assert_eq!(DepthPixels::load(&at("d.png"), 0.1).unwrap().data, [0.0, 0.4375]);
        assert_eq!(DepthPixels::load(&at("d8.png"), 1.0).unwrap().data, [0.0, 0.2]);
        assert_eq!(MaskPixels::load(&at("m.png")).unwrap().data, [true, false]);
    }

    #[test]
    fn truncated_absent_and_coloured_depth_files_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.png");
        assert_eq!(RgbPixels::load(&path), Err(DatasetError::Missing { file: path.clone() }));
        ImageBuffer::<Rgb<u8>, _>::from_pixel(64, 64, Rgb([9, 8, 7])).save(&path).unwrap();
        assert!(
            matches!(DepthPixels::load(&path, 1.0), Err(DatasetError::Malformed { file, .. }) if file == path)
        );
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        assert!(
            matches!(RgbPixels::load(&path), Err(DatasetError::Malformed { file, .. }) if file == path)
        );
        assert!(matches!(MaskPixels::load(&path), Err(DatasetError::Malformed { .. })));
    }
}
