//! Color, depth and mask images, and their files.

mod mask;

use std::array;
use std::io::{BufReader, Cursor, Seek};
use std::ops::Range;
use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageFormat};
use prehend_geometry::limits::{MAX_FILE_BYTES, MAX_PIXELS};
use prehend_geometry::{open_plain, read_plain, write_atomic};

use crate::exif::{orientation, swaps_sides};

/// Why an image could not be read, written or built.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The file's contents are no image this crate reads, or cannot be encoded.
    #[error("{}: {source}", path.display())]
    Codec {
        /// The file.
        path: PathBuf,
        /// The error of the codec.
        source: image::ImageError,
    },
    /// The file holds another kind of pixel.
    #[error("{}: expected {expected}, found {found}", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
        /// The pixel type this image needs.
        expected: &'static str,
        /// The pixel type of the file.
        found: String,
    },
    /// The number of pixels does not match the size.
    #[error("{found} pixels given for an image of {width} x {height}")]
    Size {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Pixels given.
        found: usize,
    },
    /// The file says that it has more pixels than are read.
    #[error("{}: {width} x {height} pixels, at most {MAX_PIXELS} are read", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// A depth scale is zero, negative or not finite.
    #[error("{}: depth scale {scale} m per unit, expected a finite number above zero", path.display())]
    Scale {
        /// The file.
        path: PathBuf,
        /// Meters per unit.
        scale: f64,
    },
}

macro_rules! image_type {
    ($(#[$doc:meta])* $name:ident, $pixel:ty) => {
        $(#[$doc])*
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct $name {
            width: usize,
            height: usize,
            pixels: Vec<$pixel>,
        }

        impl $name {
            /// An image of `width * height` pixels, row-major from the top-left.
            ///
            /// # Errors
            /// [`ImageError::Size`] when the number of pixels is another.
            pub fn new(width: usize, height: usize, pixels: Vec<$pixel>) -> Result<Self, ImageError> {
                if width.checked_mul(height) != Some(pixels.len()) {
                    return Err(ImageError::Size { width, height, found: pixels.len() });
                }
                Ok(Self { width, height, pixels })
            }

            /// An image of one value.
            pub fn filled(width: usize, height: usize, value: $pixel) -> Self {
                Self { width, height, pixels: vec![value; width * height] }
            }

            /// Makes it an image of one value, in the memory that it has if that is enough.
            pub fn refill(&mut self, width: usize, height: usize, value: $pixel) {
                (self.width, self.height) = (width, height);
                self.pixels.clear();
                self.pixels.resize(width * height, value);
            }

            /// Makes it a copy of `other`, in the memory that it has if that is enough.
            pub fn copy_from(&mut self, other: &Self) {
                (self.width, self.height) = (other.width, other.height);
                self.pixels.clear();
                self.pixels.extend_from_slice(&other.pixels);
            }

            /// Columns.
            pub fn width(&self) -> usize {
                self.width
            }

            /// Rows.
            pub fn height(&self) -> usize {
                self.height
            }

            /// Pixels, row-major from the top-left.
            pub fn pixels(&self) -> &[$pixel] {
                &self.pixels
            }

            /// Pixels, row-major from the top-left.
            pub fn pixels_mut(&mut self) -> &mut [$pixel] {
                &mut self.pixels
            }

            /// The pixel in column `x` and row `y`; `None` outside the image.
            pub fn get(&self, x: usize, y: usize) -> Option<$pixel> {
                (x < self.width && y < self.height).then(|| self.pixels[y * self.width + x])
            }
        }
    };
}

image_type! {
    /// A color image, row-major from the top-left; channels in 0..=1 as stored in files.
    RgbImage, [f32; 3]
}
image_type! {
    /// A depth image: Z in the camera frame \[m\], 0 where nothing was measured; row-major from the top-left.
    DepthImage, f32
}
image_type! {
    /// A binary image, row-major from the top-left.
    Mask, bool
}

impl RgbImage {
    /// Reads a PNG or JPEG file; gray becomes three equal channels and alpha is dropped. As all images, it is turned as its EXIF metadata say.
    ///
    /// # Errors
    /// When the file cannot be read or decoded.
    pub fn load(path: &Path) -> Result<Self, ImageError> {
        Self::decode(&read(path)?, path)
    }

    /// The image whose PNG or JPEG file has the contents `bytes`; errors call it `name`.
    ///
    /// # Errors
    /// When they cannot be decoded.
    pub fn decode(bytes: &[u8], name: &Path) -> Result<Self, ImageError> {
        let image = decode(bytes, name)?;
        let (width, height) = (image.width() as usize, image.height() as usize);
        let pixels = match image {
            // Without a second copy of 12 bytes a pixel.
            DynamicImage::ImageRgb8(image) => {
                let channel: [f32; 256] = array::from_fn(|byte| byte as f32 / 255.0);
                let (pixels, _) = image.as_raw().as_chunks();
                pixels.iter().map(|p: &[u8; 3]| p.map(|c| channel[usize::from(c)])).collect()
            }
            other => other.into_rgb32f().pixels().map(|p| p.0).collect(),
        };
        Self::new(width, height, pixels)
    }

    /// Writes 8 bits a channel as PNG or JPEG, by the extension, atomically; values are clamped to 0..=1.
    ///
    /// # Errors
    /// When the format is unknown or the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), ImageError> {
        let image =
            image::RgbImage::from_raw(self.width as u32, self.height as u32, self.to_bytes());
        encode(path, image.map(DynamicImage::ImageRgb8))
    }

    /// Writes 8 bits a channel as JPEG of quality `quality` (1..=100, clamped), atomically; values are clamped to 0..=1.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn save_jpeg(&self, path: &Path, quality: u8) -> Result<(), ImageError> {
        let bytes = self.to_jpeg(quality);
        let bytes = bytes.map_err(|source| ImageError::Codec { path: path.into(), source })?;
        write_atomic(path, &bytes).map_err(|source| ImageError::Io { path: path.into(), source })
    }

    /// The contents of a JPEG file of quality `quality` (1..=100, clamped); values are clamped to 0..=1.
    ///
    /// # Errors
    /// When it cannot be encoded: it has more than 65535 columns or rows, or none.
    pub fn to_jpeg(&self, quality: u8) -> Result<Vec<u8>, image::ImageError> {
        let (width, height) = (self.width as u32, self.height as u32);
        let mut bytes = Vec::new();
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, quality.clamp(1, 100))
            .encode(&self.to_bytes(), width, height, image::ExtendedColorType::Rgb8)?;
        Ok(bytes)
    }

    /// Three bytes a pixel, row by row; values are clamped to 0..=1.
    pub fn to_bytes(&self) -> Vec<u8> {
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        self.pixels.iter().flat_map(|p| p.map(byte)).collect()
    }

    /// The mean of every block of `factor` by `factor` pixels.
    pub fn downsampled(&self, factor: usize) -> Self {
        let (width, height, pixels) = blocks(&self.pixels, self.width, factor, |block| {
            let mut sum = [0.0f32; 3];
            block.iter().for_each(|p| (0..3).for_each(|c| sum[c] += p[c]));
            sum.map(|s| s / block.len() as f32)
        });
        Self { width, height, pixels }
    }
}

impl DepthImage {
    /// Reads a 16-bit gray PNG file whose unit is `scale` meters (BOP: `depth_scale * 0.001`).
    ///
    /// # Errors
    /// When the file cannot be read, is not 16-bit gray, or `scale` is not positive.
    pub fn load(path: &Path, scale: f64) -> Result<Self, ImageError> {
        Self::decode(&read(path)?, scale, path)
    }

    /// Depth image of a 16-bit gray PNG file with contents `bytes`, whose unit is `scale` meters; errors call it `name`.
    ///
    /// # Errors
    /// When they cannot be decoded or are not 16-bit gray, or `scale` is not positive.
    pub fn decode(bytes: &[u8], scale: f64, name: &Path) -> Result<Self, ImageError> {
        check_scale(name, scale)?;
        let image = match decode(bytes, name)? {
            DynamicImage::ImageLuma16(image) => image,
            other => {
                return Err(ImageError::Kind {
                    path: name.into(),
                    expected: "16-bit gray",
                    found: format!("{:?}", other.color()),
                });
            }
        };
        let (width, height) = (image.width() as usize, image.height() as usize);
        let meters = |units: &u16| (f64::from(*units) * scale) as f32;
        Self::new(width, height, image.as_raw().iter().map(meters).collect())
    }

    /// Writes a 16-bit gray PNG file whose unit is `scale` meters, atomically; depths beyond 65535 units saturate.
    ///
    /// # Errors
    /// When `scale` is not positive or the file cannot be written.
    pub fn save(&self, path: &Path, scale: f64) -> Result<(), ImageError> {
        check_scale(path, scale)?;
        let units = |z: &f32| (*z as f64 / scale).round().clamp(0.0, 65535.0) as u16;
        let data = self.pixels.iter().map(units).collect();
        let image = image::ImageBuffer::from_raw(self.width as u32, self.height as u32, data);
        encode(path, image.map(DynamicImage::ImageLuma16))
    }

    /// The lower median of the valid depths of every block of `factor` by `factor` pixels (a mean would
    /// invent surfaces between foreground and background); 0 where fewer than half are valid.
    pub fn downsampled(&self, factor: usize) -> Self {
        let all = [0..self.width, 0..self.height];
        Self::downsampled_of(self.width, self.height, factor, all, |at| self.pixels[at])
    }

    /// Lower medians as of [`downsampled`](Self::downsampled), for an image of `width` by `height` pixels that is not stored: `depth` is its
    /// depth \[m\] at a row-major index, taken as 0 beyond the columns and rows `within`.
    pub fn downsampled_of(
        width: usize,
        height: usize,
        factor: usize,
        within: [Range<usize>; 2],
        depth: impl Fn(usize) -> f32,
    ) -> Self {
        let factor = factor.max(1);
        let mut small = Self::filled(width / factor, height / factor, 0.0);
        let [columns, rows] = within;
        let (columns, rows) =
            (columns.start..columns.end.min(width), rows.start..rows.end.min(height));
        let last = [columns.end.div_ceil(factor), rows.end.div_ceil(factor)];
        let last = [last[0].min(small.width), last[1].min(small.height)];
        let mut valid = vec![0; factor * factor];
        let part = |of: &Range<usize>, block: usize| {
            of.start.max(block * factor)..of.end.min((block + 1) * factor)
        };
        for y in rows.start / factor..last[1] {
            for x in columns.start / factor..last[0] {
                let mut count = 0;
                for row in part(&rows, y) {
                    for column in part(&columns, x) {
                        let depth = depth(row * width + column);
                        // Floats above zero are in the order of their bits, which are sorted sooner.
                        valid[count] = depth.to_bits();
                        count += usize::from(depth > 0.0);
                    }
                }
                if count == 0 || count * 2 < factor * factor {
                    continue;
                }
                valid[..count].sort_unstable();
                small.pixels[y * small.width + x] = f32::from_bits(valid[(count - 1) / 2]);
            }
        }
        small
    }
}

/// One pixel of every block of `factor` by `factor` in rows of `width`, incomplete blocks dropped: width, height and pixels.
fn blocks<T: Copy>(
    pixels: &[T],
    width: usize,
    factor: usize,
    mut reduce: impl FnMut(&[T]) -> T,
) -> (usize, usize, Vec<T>) {
    let factor = factor.max(1);
    let height = pixels.len() / width.max(1);
    let (columns, rows) = (width / factor, height / factor);
    let mut block = Vec::with_capacity(factor * factor);
    let mut reduced = Vec::with_capacity(columns * rows);
    for y in 0..rows {
        for x in 0..columns {
            block.clear();
            for row in y * factor..(y + 1) * factor {
                let start = row * width + x * factor;
                block.extend_from_slice(&pixels[start..start + factor]);
            }
            reduced.push(reduce(&block));
        }
    }
    (columns, rows, reduced)
}

fn check_scale(path: &Path, scale: f64) -> Result<(), ImageError> {
    if scale.is_finite() && scale > 0.0 {
        return Ok(());
    }
    Err(ImageError::Scale { path: path.into(), scale })
}

fn read(path: &Path) -> Result<Vec<u8>, ImageError> {
    read_plain(path, MAX_FILE_BYTES).map_err(|source| ImageError::Io { path: path.into(), source })
}

fn decode(bytes: &[u8], name: &Path) -> Result<DynamicImage, ImageError> {
    let io = |source| ImageError::Io { path: name.into(), source };
    let reader = || image::ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(io);
    let codec = |source| ImageError::Codec { path: name.into(), source };
    // The size stands in the header: a few bytes may claim, and compress, any number of pixels.
    let (width, height) = reader()?.into_dimensions().map_err(codec)?;
    if u64::from(width) * u64::from(height) > MAX_PIXELS as u64 {
        return Err(ImageError::TooLarge { path: name.into(), width, height });
    }
    let mut image = reader()?.decode().map_err(codec)?;
    image.apply_orientation(orientation(Cursor::new(bytes)));
    Ok(image)
}

/// Columns and rows of the upright image in a PNG or JPEG file, by its header: nothing is decoded.
///
/// # Errors
/// When the file cannot be read, is no plain file or no image.
pub fn image_size(path: &Path) -> Result<(usize, usize), ImageError> {
    let io = |source| ImageError::Io { path: path.into(), source };
    let file = open_plain(path).map_err(io)?;
    if file.metadata().map_err(io)?.len() > MAX_FILE_BYTES as u64 {
        // The decoder of JPEG reads all of it.
        return Err(io(std::io::ErrorKind::FileTooLarge.into()));
    }
    let reader =
        image::ImageReader::new(BufReader::new(&file)).with_guessed_format().map_err(io)?;
    let size = reader.into_dimensions();
    let (width, height) = size.map_err(|source| ImageError::Codec { path: path.into(), source })?;
    let (width, height) = (width as usize, height as usize);
    (&file).rewind().map_err(io)?;
    let swapped = swaps_sides(orientation(BufReader::new(&file)));
    Ok(if swapped { (height, width) } else { (width, height) })
}

/// Encodes in memory, to write the file atomically.
fn encode(path: &Path, image: Option<DynamicImage>) -> Result<(), ImageError> {
    let codec = |source| ImageError::Codec { path: path.into(), source };
    let format = ImageFormat::from_path(path).map_err(codec)?;
    let mut bytes = Cursor::new(Vec::new());
    if let Some(image) = image {
        image.write_to(&mut bytes, format).map_err(codec)?;
    }
    write_atomic(path, bytes.get_ref())
        .map_err(|source| ImageError::Io { path: path.into(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_survive_a_round_trip_through_files() {
        let dir = tempfile::tempdir().unwrap();
        let color: Vec<[f32; 3]> =
            (0..6).map(|i| [i as f32 / 255.0, 0.2, 1.0 - i as f32 / 255.0]).collect();
        let color = RgbImage::new(3, 2, color).unwrap();
        color.save(&dir.path().join("c.png")).unwrap();
        let back = RgbImage::load(&dir.path().join("c.png")).unwrap();
        for (a, b) in color.pixels().iter().zip(back.pixels()) {
            (0..3).for_each(|c| assert!((a[c] - b[c]).abs() < 1e-6));
        }
        let depth = DepthImage::new(2, 2, vec![0.0, 0.4567, 1.0, 9.0]).unwrap();
        depth.save(&dir.path().join("d.png"), 1e-4).unwrap();
        let back = DepthImage::load(&dir.path().join("d.png"), 1e-4).unwrap();
        assert_eq!(back.pixels()[..3], [0.0, 0.4567, 1.0]);
        assert!((back.pixels()[3] - 6.5535).abs() < 1e-6);
        let mask = Mask::new(3, 1, vec![true, false, true]).unwrap();
        mask.save(&dir.path().join("m.png")).unwrap();
        assert_eq!(Mask::load(&dir.path().join("m.png")).unwrap(), mask);
        // Only the finished files are left.
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 3);
    }

    /// A PNG file of zeros takes a thousandth of its pixels.
    #[test]
    fn images_of_too_many_pixels_are_refused_by_their_headers() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("large.png");
        image::GrayImage::new(12_000, 12_000).save(&path).unwrap();
        for read in [RgbImage::load(&path).err(), Mask::load(&path).err()] {
            assert!(matches!(read, Some(ImageError::TooLarge { width: 12_000, .. })), "{read:?}");
        }
    }

    #[test]
    fn errors_name_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let missing = dir.path().join("absent.png");
        assert!(RgbImage::load(&missing).unwrap_err().to_string().contains("absent.png"));
        let broken = dir.path().join("broken.png");
        std::fs::write(&broken, b"no picture").unwrap();
        assert!(Mask::load(&broken).unwrap_err().to_string().contains("broken.png"));
        let eight_bit = dir.path().join("eight.png");
        Mask::filled(2, 2, true).save(&eight_bit).unwrap();
        assert!(matches!(DepthImage::load(&eight_bit, 1e-3), Err(ImageError::Kind { .. })));
        let color = RgbImage::filled(1, 1, [0.0; 3]);
        assert!(color.save(&dir.path().join("x.unknown")).is_err());
        assert!(color.save(&dir.path().join("no/folder.png")).is_err());
        assert!(matches!(Mask::new(2, 2, vec![true]), Err(ImageError::Size { found: 1, .. })));
        assert!(matches!(DepthImage::load(&eight_bit, 0.0), Err(ImageError::Scale { .. })));
    }

    #[test]
    fn downsampling_reduces_blocks() {
        let color = RgbImage::new(2, 2, vec![[0.0; 3], [1.0; 3], [0.5; 3], [0.5; 3]]).unwrap();
        assert_eq!(color.downsampled(2).pixels(), [[0.5; 3]]);
        let depth = DepthImage::new(2, 2, vec![0.0, 1.0, 2.0, 5.0]).unwrap();
        assert_eq!(depth.downsampled(2).pixels(), [2.0]);
        let mask = Mask::new(3, 2, vec![true, false, true, false, true, true]).unwrap();
        assert_eq!(mask.downsampled(2).pixels(), [true]);
        assert_eq!(mask.downsampled(2).width(), 1);
    }
}
