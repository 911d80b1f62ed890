//! Images of messages.

use std::path::Path;

use prehend_geometry::limits::MAX_PIXELS;
use prehend_render::{DepthImage, Mask, RgbImage};

use crate::data::bop::drop_saturated;

use super::messages::{
    COMPRESSED_IMAGE, CompressedImage, IMAGE, RosHeader, RosImage, Stamped, decode,
};

/// Kind of the images of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Content {
    Color,
    /// One channel of eight bits.
    Gray,
    Depth,
}

/// When and in which frame a message was taken, and what it shows by what it says of itself.
pub(super) fn describe(kind: &str, data: &[u8]) -> Result<(RosHeader, Content), String> {
    let (header, encoding) = if kind == IMAGE {
        let image: Stamped<RosImage<'_>> = decode(data)?;
        (image.header, image.content.encoding)
    } else {
        let image: Stamped<CompressedImage<'_>> = decode(data)?;
        (image.header, image.content.format)
    };
    let encoding = encoding.to_ascii_lowercase();
    let has = |names: &[&str]| names.iter().any(|name| encoding.starts_with(name));
    let content = if has(&["16uc1", "mono16", "32fc1"]) {
        Content::Depth
    } else if has(&["mono8", "8uc1"]) {
        Content::Gray
    } else {
        Content::Color
    };
    Ok((header, content))
}

/// A color image.
pub(super) fn color(kind: &str, data: &[u8]) -> Result<RgbImage, String> {
    if kind == COMPRESSED_IMAGE {
        let image = decode::<Stamped<CompressedImage<'_>>>(data)?.content;
        return RgbImage::decode(image.data, Path::new(image.format)).map_err(|e| e.to_string());
    }
    let image = decode::<Stamped<RosImage<'_>>>(data)?.content;
    let [r, g, b, channels] = match image.encoding {
        "rgb8" => [0, 1, 2, 3],
        "bgr8" | "8UC3" => [2, 1, 0, 3],
        "rgba8" => [0, 1, 2, 4],
        "bgra8" | "8UC4" => [2, 1, 0, 4],
        "mono8" | "8UC1" => [0, 0, 0, 1],
        other => return Err(format!("images encoded as {other:?} are not read")),
    };
    let level = |byte: u8| f32::from(byte) / 255.0;
    let pixels = rows(&image, channels)?.flat_map(|row| row.chunks_exact(channels));
    let pixels = pixels.map(|p| [r, g, b].map(|at| level(p[at]))).collect();
    sized(&image, |width, height| RgbImage::new(width, height, pixels))
}

/// Depth \[m\].
pub(super) fn depth(kind: &str, data: &[u8]) -> Result<DepthImage, String> {
    if kind == COMPRESSED_IMAGE {
        let image = decode::<Stamped<CompressedImage<'_>>>(data)?.content;
        // `compressed_depth_image_transport` puts what 32-bit images are quantized with before the PNG.
        let png = match image.format.contains("compressedDepth") {
            true => image.data.get(12..).unwrap_or_default(),
            false => image.data,
        };
        if image.format.starts_with("32FC1") {
            return Err("compressed depth is read if it has 16 bits, not 32".to_owned());
        }
        let name = Path::new(image.format);
        let mut depth = DepthImage::decode(png, MILLIMETER, name).map_err(|e| e.to_string())?;
        drop_saturated(&mut depth, MILLIMETER);
        return Ok(depth);
    }
    let image = decode::<Stamped<RosImage<'_>>>(data)?.content;
    let is_big = image.is_bigendian != 0;
    let pixels: Vec<f32> = match image.encoding {
        "16UC1" | "mono16" => {
            let meters = |bytes| match u16::from_le_bytes(ordered(is_big, bytes)) {
                u16::MAX => 0.0,
                units => (f64::from(units) * MILLIMETER) as f32,
            };
            rows(&image, 2)?.flat_map(|row| row.as_chunks().0).map(|b| meters(*b)).collect()
        }
        "32FC1" => {
            // Where nothing was measured there is no number.
            let measured = |z: f32| if z.is_finite() && z > 0.0 { z } else { 0.0 };
            let all = rows(&image, 4)?.flat_map(|row| row.as_chunks().0);
            all.map(|b| measured(f32::from_le_bytes(ordered(is_big, *b)))).collect()
        }
        other => return Err(format!("depth encoded as {other:?} is not read")),
    };
    sized(&image, |width, height| DepthImage::new(width, height, pixels))
}

/// The bytes of a number, the lowest first.
fn ordered<const N: usize>(is_big: bool, mut bytes: [u8; N]) -> [u8; N] {
    if is_big {
        bytes.reverse();
    }
    bytes
}

/// Whole numbers of depth are millimeters (REP 118).
const MILLIMETER: f64 = 1e-3;

/// A mask: set where a pixel is not black.
pub(super) fn mask(kind: &str, data: &[u8]) -> Result<Mask, String> {
    let image = color(kind, data)?;
    let set = image.pixels().iter().map(|pixel| pixel.iter().any(|v| *v > 0.0)).collect();
    Mask::new(image.width(), image.height(), set).map_err(|e| e.to_string())
}

/// Rows of the pixels of `image`, each of so many bytes.
fn rows<'a>(image: &RosImage<'a>, bytes: usize) -> Result<impl Iterator<Item = &'a [u8]>, String> {
    let (width, step) = (image.width as usize * bytes, image.step as usize);
    let needed = (image.height as usize).checked_sub(1).map(|rows| {
        // Of sizes that need not be true.
        rows.saturating_mul(step).saturating_add(width)
    });
    if width == 0 || step < width || needed.is_none_or(|needed| image.data.len() < needed) {
        return Err(format!(
            "{} bytes in rows of {step} are no {}x{} pixels encoded as {:?}",
            image.data.len(),
            image.width,
            image.height,
            image.encoding
        ));
    }
    let height = image.height as usize;
    if height.saturating_mul(image.width as usize) > MAX_PIXELS {
        return Err(format!("{}x{height} pixels, at most {MAX_PIXELS} are read", image.width));
    }
    Ok(image.data.chunks(step).take(height).map(move |row| &row[..width]))
}

fn sized<T>(
    image: &RosImage<'_>,
    make: impl FnOnce(usize, usize) -> Result<T, prehend_render::ImageError>,
) -> Result<T, String> {
    make(image.width as usize, image.height as usize).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::mcap::messages::encode;

    fn image(encoding: &str, size: [u32; 2], step: u32, data: &[u8]) -> Vec<u8> {
        let [width, height] = size;
        let content = RosImage { height, width, encoding, is_bigendian: 0, step, data };
        encode(&Stamped { header: RosHeader::default(), content }).unwrap()
    }

    #[test]
    fn pixels_are_read_by_their_encoding_and_padding_is_left_out() {
        let bytes = [10, 20, 30, 40, 50, 60, 0, 0, 70, 80, 90, 100, 110, 120];
        let level = |bytes: [u8; 3]| bytes.map(|b| f32::from(b) / 255.0);
        let read = |encoding| color(IMAGE, &image(encoding, [2, 2], 8, &bytes)).unwrap();
        assert_eq!(read("rgb8").pixels()[1], level([40, 50, 60]));
        assert_eq!(read("bgr8").pixels()[2], level([90, 80, 70]));
        let two = [0x10, 0x27, 0, 0];
        let read = depth(IMAGE, &image("16UC1", [2, 1], 4, &two)).unwrap();
        assert_eq!(read.pixels(), [10.0, 0.0]);
        let floats = [1.5f32, f32::NAN, -1.0].map(f32::to_le_bytes).concat();
        let read = depth(IMAGE, &image("32FC1", [3, 1], 12, &floats)).unwrap();
        assert_eq!(read.pixels(), [1.5, 0.0, 0.0]);
        let read = mask(IMAGE, &image("mono8", [3, 1], 3, &[0, 1, 255])).unwrap();
        assert_eq!(read.pixels(), [false, true, true]);
    }

    #[test]
    fn what_is_no_image_is_told() {
        let told = |bytes: &[u8]| color(IMAGE, bytes).unwrap_err();
        assert!(told(&image("rgb8", [2, 2], 6, &[0; 11])).contains("11 bytes in rows of 6"));
        assert!(told(&image("rgb8", [u32::MAX, u32::MAX], u32::MAX, &[0; 9])).contains("9 bytes"));
        assert!(told(&image("bayer_rggb8", [1, 1], 1, &[0])).contains("bayer_rggb8"));
        assert!(told(&[]).contains("0 bytes are no message"));
        assert!(!told(&image("rgb8", [1, 1], 3, &[0; 3])[..20]).is_empty());
    }
}
