//! Texture images: decoding and encoding.

use std::io::Cursor;
use std::path::Path;

use image::{ImageFormat, ImageReader, RgbImage};

use super::limits::{MAX_FILE_BYTES, MAX_PIXELS};
use super::read_plain;
use super::{MeshError, Result, companion};
use crate::mesh::Texture;

impl Texture {
    /// Reads a PNG or JPEG image; gray images become RGB, alpha is dropped.
    ///
    /// # Errors
    /// [`MeshError::Texture`] where the file is missing, not an image, or larger than [`limits`](crate::limits) allow.
    pub(crate) fn load(path: &Path) -> Result<Texture> {
        let name = path.display().to_string();
        let bytes =
            read_plain(path, MAX_FILE_BYTES).map_err(|e| MeshError::texture(path, &name, e))?;
        decode(&bytes, path, &name, MAX_PIXELS)
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

/// The content of the file `name` in the folder of the mesh at `path`.
pub(super) fn beside(path: &Path, name: &str) -> Result<Vec<u8>, String> {
    let file = companion(path, name)?;
    read_plain(&file, MAX_FILE_BYTES).map_err(|e| e.to_string())
}

/// As [`beside`], or else the content of the file of that name in the folder of the mesh itself, in whatever case: names come from
/// other machines, as `C:\art\TEX.PNG` does.
pub(super) fn near(path: &Path, name: &str) -> Result<Vec<u8>, String> {
    beside(path, name).or_else(|reason| {
        let bare = name.trim().rsplit(['/', '\\']).next().unwrap_or_default();
        let entries = companion(path, ".")?.read_dir().into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
        let alike = names.filter(|own| own.eq_ignore_ascii_case(bare));
        let nearest = alike.min_by_key(|own| (own != bare, own.clone()));
        beside(path, &nearest.ok_or(reason)?)
    })
}

/// Decodes an image of at most `limit` pixels that is embedded in, or named by, the mesh at `path`.
pub(super) fn decode(bytes: &[u8], path: &Path, name: &str, limit: usize) -> Result<Texture> {
    let fault = |e: String| MeshError::texture(path, name, e);
    let reader = || {
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| fault(e.to_string()))
    };
    // The size stands in the header: a few bytes may claim, and compress, any number of pixels.
    let (width, height) = reader()?.into_dimensions().map_err(|e| fault(e.to_string()))?;
    let pixels = u64::from(width) * u64::from(height);
    if pixels > limit as u64 {
        return Err(fault(format!("{pixels} pixels, more than the limit of {limit} that is left")));
    }
    let rgb = reader()?.decode().map_err(|e| fault(e.to_string()))?.into_rgb8();
    let (width, height) = (rgb.width() as usize, rgb.height() as usize);
    Ok(Texture { width, height, pixels: rgb.pixels().map(|p| p.0).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_other_machines_are_found_in_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.obj");
        std::fs::write(folder.path().join("TEX.png"), "in capitals").unwrap();
        for name in ["tex.PNG", "C:\\art\\Tex.png", "/art/tex.png", "../tex.png"] {
            assert_eq!(near(&path, name).unwrap(), b"in capitals", "{name}");
        }
        std::fs::write(folder.path().join("tex.png"), "own").unwrap();
        assert_eq!(near(&path, "C:\\art\\tex.png").unwrap(), b"own");
        for name in ["other.png", "art/", ""] {
            assert!(near(&path, name).is_err(), "{name}");
        }
    }

    #[test]
    fn png_round_trip_and_broken_images() {
        let texture =
            Texture { width: 3, height: 2, pixels: (0..6).map(|k| [k, 2 * k, 255 - k]).collect() };
        let png = texture.encode_png().unwrap();
        assert_eq!(decode(&png, Path::new("m.ply"), "t.png", 6).unwrap(), texture);
        let error =
            decode(&png[..png.len() / 2], Path::new("m.ply"), "t.png", 6).unwrap_err().to_string();
        assert!(error.starts_with("m.ply: texture t.png: "), "{error}");
        assert!(decode(b"not an image", Path::new("m.ply"), "t.png", 6).is_err());
        let error = decode(&png, Path::new("m.ply"), "t.png", 5).unwrap_err().to_string();
        assert!(error.contains("6 pixels, more than the limit"), "{error}");
        assert!(Texture { width: 3, height: 3, ..texture }.encode_png().is_err());
        assert!(matches!(Texture::load(Path::new("none.png")), Err(MeshError::Texture { .. })));
    }
}
