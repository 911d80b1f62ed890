//! Texture images: decoding and encoding.

use std::io::Cursor;
use std::path::Path;

use image::{ImageFormat, ImageReader, RgbImage};

use super::{MeshError, companion};
use crate::Texture;

impl Texture {
    /// Reads a PNG or JPEG image; grey images become RGB, alpha is dropped.
    ///
    /// # Errors
    /// [`MeshError::Texture`] where the file is missing or not an image.
    pub fn load(path: &Path) -> Result<Texture, MeshError> {
        let name = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|e| MeshError::texture(path, &name, e))?;
        decode(&bytes, path, &name)
    }

    /// The image as PNG.
    pub(super) fn encode_png(&self) -> Result<Vec<u8>, std::io::Error> {
        let invalid = |e: String| std::io::Error::new(std::io::ErrorKind::InvalidData, e);
        let (w, h) = (u32::try_from(self.width), u32::try_from(self.height));
        let size = w.ok().zip(h.ok()).ok_or_else(|| invalid("texture too large".into()))?;
        let image = RgbImage::from_raw(size.0, size.1, self.pixels.concat()).ok_or_else(|| {
            invalid(format!("texture of {size:?} holds {} pixels", self.pixels.len()))
        })?;
        let mut out = Cursor::new(Vec::new());
        image.write_to(&mut out, ImageFormat::Png).map_err(|e| invalid(e.to_string()))?;
        Ok(out.into_inner())
    }
}

/// Reads the image `name` from the folder of the mesh at `path`.
pub(super) fn load_companion(path: &Path, name: &str) -> Result<Texture, MeshError> {
    let file = companion(path, name).map_err(|e| MeshError::texture(path, name, e))?;
    let bytes = std::fs::read(file).map_err(|e| MeshError::texture(path, name, e))?;
    decode(&bytes, path, name)
}

/// Decodes an image embedded in, or named by, the mesh at `path`.
pub(super) fn decode(bytes: &[u8], path: &Path, name: &str) -> Result<Texture, MeshError> {
    // The reader's default limits keep a hostile image from allocating more than 512 MiB.
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let image = reader.map_err(|e| MeshError::texture(path, name, e))?.decode();
    let rgb = image.map_err(|e| MeshError::texture(path, name, e))?.into_rgb8();
    let (width, height) = (rgb.width() as usize, rgb.height() as usize);
    Ok(Texture { width, height, pixels: rgb.pixels().map(|p| p.0).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_round_trip_and_broken_images() {
        let texture =
            Texture { width: 3, height: 2, pixels: (0..6).map(|k| [k, 2 * k, 255 - k]).collect() };
        let png = texture.encode_png().unwrap();
        assert_eq!(decode(&png, Path::new("m.ply"), "t.png").unwrap(), texture);
        let error =
            decode(&png[..png.len() / 2], Path::new("m.ply"), "t.png").unwrap_err().to_string();
        assert!(error.starts_with("m.ply: texture t.png: "), "{error}");
        assert!(decode(b"not an image", Path::new("m.ply"), "t.png").is_err());
        assert!(Texture { width: 3, height: 3, ..texture }.encode_png().is_err());
        assert!(matches!(Texture::load(Path::new("none.png")), Err(MeshError::Texture { .. })));
    }
}
