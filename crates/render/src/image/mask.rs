//! Masks, and their files.

use std::path::Path;

use image::{DynamicImage, ImageFormat};

use super::{ImageError, Mask, blocks, decode, encode, read};
use crate::projected::Region;

impl Mask {
    /// Mask of an image file: set where the gray value is not zero, as BOP has it, or in a JPEG file above half of the largest. Of an image with an alpha
    /// channel also that must be set; where the colors are all alike it tells alone.
    ///
    /// # Errors
    /// When the file cannot be read or decoded.
    pub fn load(path: &Path) -> Result<Self, ImageError> {
        let bytes = read(path)?;
        let image = decode(&bytes, path)?;
        let (width, height) = (image.width() as usize, image.height() as usize);
        let is_lossy = image::guess_format(&bytes).is_ok_and(|f| f == ImageFormat::Jpeg);
        // Most masks.
        if let (DynamicImage::ImageLuma8(image), false) = (&image, is_lossy) {
            let pixels = image.as_raw().iter().map(|gray| *gray > 0).collect();
            return Self::new(width, height, pixels);
        }
        let has_alpha = image.color().has_alpha();
        // 16 bits, or the smallest values of a 16-bit file would round to zero.
        let image = image.into_luma_alpha16();
        let gray = || image.pixels().map(|pixel| pixel.0[0]);
        let largest = gray().max().unwrap_or_default();
        let above = if is_lossy { largest / 2 } else { 0 };
        let tells = has_alpha && image.pixels().any(|pixel| pixel.0[1] == 0);
        let is_flat = tells && gray().all(|value| value == largest);
        let is_set = |[gray, alpha]: [u16; 2]| alpha > 0 && (is_flat || gray > above);
        Self::new(width, height, image.pixels().map(|pixel| is_set(pixel.0)).collect())
    }

    /// True where all of its bounding box is set.
    pub fn is_box(&self) -> bool {
        self.bounds().is_some_and(|[.., width, height]| width * height == self.count())
    }

    /// Mask of `width` by `height` pixels that is set in a box: left, top, width and height, as far as that is within.
    pub fn of_box(width: usize, height: usize, [left, top, columns, rows]: [usize; 4]) -> Self {
        let mut mask = Self::filled(width, height, false);
        let (right, bottom) = (left.saturating_add(columns), top.saturating_add(rows));
        for row in mask.pixels.chunks_mut(width.max(1)).take(bottom).skip(top) {
            row[left.min(width)..right.min(width)].fill(true);
        }
        mask
    }

    /// Writes an 8-bit gray file, 255 where set, atomically.
    ///
    /// # Errors
    /// When the format is unknown or the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), ImageError> {
        let bytes = self.pixels.iter().map(|&m| if m { 255 } else { 0 }).collect();
        let image = image::GrayImage::from_raw(self.width as u32, self.height as u32, bytes);
        encode(path, image.map(DynamicImage::ImageLuma8))
    }

    /// Set where at least half of a block of `factor` by `factor` pixels is set.
    pub fn downsampled(&self, factor: usize) -> Self {
        let most = |block: &[bool]| block.iter().filter(|m| **m).count() * 2 >= block.len();
        let (width, height, pixels) = blocks(&self.pixels, self.width, factor, most);
        Self { width, height, pixels }
    }

    /// Number of set pixels.
    pub fn count(&self) -> usize {
        // In parts that a byte can count: side by side, a tenth of the time.
        let part = |part: &[bool]| part.iter().map(|m| u8::from(*m)).sum::<u8>();
        self.pixels.chunks(255).map(|pixels| usize::from(part(pixels))).sum()
    }

    /// Left, top, width and height of the smallest rectangle around all set pixels, if there are any.
    pub fn bounds(&self) -> Option<[usize; 4]> {
        let Region { x0, y0, x1, y1 } = Region::around_mask(self.width, &self.pixels)?;
        Some([x0, y0, x1 - x0, y1 - y0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_are_read_as_they_are_written() {
        let dir = tempfile::tempdir().unwrap();
        let expected = [false, true, true, false];
        let is_read = |name: &str, image: DynamicImage| {
            let file = dir.path().join(name);
            image.save(&file).unwrap();
            Mask::load(&file).unwrap().pixels() == expected
        };
        let gray = |values: [u8; 4]| {
            DynamicImage::ImageLuma8(image::GrayImage::from_raw(4, 1, values.to_vec()).unwrap())
        };
        assert!(is_read("one.png", gray([0, 1, 1, 0])));
        assert!(is_read("labels.png", gray([0, 3, 7, 0])));
        assert!(is_read("rgb.png", gray([0, 255, 40, 0]).into_rgb8().into()));
        let rgba = |pixels: [[u8; 4]; 4]| -> DynamicImage {
            image::RgbaImage::from_raw(4, 1, pixels.concat()).unwrap().into()
        };
        let [white, clear, black] = [[255; 4], [255, 255, 255, 0], [0, 0, 0, 255]];
        assert!(is_read("alpha.png", rgba([clear, white, white, clear])));
        assert!(is_read("opaque.png", rgba([black, white, white, black])));
        let none = Mask::load(&{
            let file = dir.path().join("none.png");
            rgba([black; 4]).save(&file).unwrap();
            file
        });
        assert_eq!(none.unwrap().count(), 0);
        // Blocks of 8 by 8 pixels, each with errors of its own.
        let wide = image::GrayImage::from_fn(64, 16, |x, y| {
            image::Luma([if (20..44).contains(&x) && y > 4 { 255 } else { 0 }])
        });
        let file = dir.path().join("mask.jpg");
        wide.save(&file).unwrap();
        let mask = Mask::load(&file).unwrap();
        assert_eq!(mask.bounds(), Some([20, 5, 24, 11]));
        assert!(mask.is_box());
        assert_eq!(Mask::of_box(64, 16, [20, 5, 24, 99]), mask);
    }

    #[test]
    fn any_value_but_zero_sets_a_mask_pixel() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.png");
        image::GrayImage::from_raw(4, 1, vec![0, 1, 127, 255]).unwrap().save(&path).unwrap();
        assert_eq!(Mask::load(&path).unwrap().pixels(), [false, true, true, true]);
        let deep = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(2, 1, vec![0u16, 1]);
        deep.unwrap().save(&path).unwrap();
        assert_eq!(Mask::load(&path).unwrap().pixels(), [false, true]);
    }
}
