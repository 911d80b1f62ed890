//! The images of one mesh: each decoded once, and not more of them than the limit allows.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::limits::MAX_PIXELS;
use super::{MeshError, texture};
use crate::mesh::Texture;

/// Images decoded so far, by name.
pub(super) struct Images<'a> {
    path: &'a Path,
    known: BTreeMap<String, Arc<Texture>>,
    left: usize,
}

impl<'a> Images<'a> {
    pub(super) fn new(path: &'a Path) -> Self {
        Self { path, known: BTreeMap::new(), left: MAX_PIXELS }
    }

    /// The image `name`, decoded from what `bytes` gives unless it is known.
    pub(super) fn get(
        &mut self,
        name: &str,
        bytes: impl FnOnce() -> Result<Vec<u8>, String>,
    ) -> Result<Arc<Texture>, MeshError> {
        if let Some(known) = self.known.get(name) {
            return Ok(known.clone());
        }
        // Names may be whole `data:` URIs.
        let shown: String = name.chars().take(64).collect();
        let bytes = bytes().map_err(|e| MeshError::texture(self.path, &shown, e))?;
        let image = Arc::new(texture::decode(&bytes, self.path, &shown, self.left)?);
        self.left = self.left.saturating_sub(image.pixels.len());
        self.known.insert(name.into(), image.clone());
        Ok(image)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_share_one_allowance() {
        let png = Texture { width: 4, height: 2, pixels: vec![[1, 2, 3]; 8] }.encode_png().unwrap();
        let mut images = Images { left: 20, ..Images::new(Path::new("m.glb")) };
        let a = images.get("a", || Ok(png.clone())).unwrap();
        assert!(Arc::ptr_eq(&a, &images.get("a", || Err("read twice".into())).unwrap()));
        images.get("b", || Ok(png.clone())).unwrap();
        let error = images.get("c", || Ok(png.clone())).unwrap_err().to_string();
        assert_eq!(error, "m.glb: texture c: 8 pixels, more than the limit of 4 that is left");
        assert!(
            images.get("d", || Err("gone".into())).unwrap_err().to_string().contains("d: gone")
        );
    }
}
