//! The images of one mesh: each decoded once, and not more of them than the limit allows. One that cannot be read costs the colors, not the mesh.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::limits::MAX_PIXELS;
use super::{MeshError, Result, texture};
use crate::mesh::Texture;

/// Images decoded so far, by name.
pub(super) struct Images<'a> {
    path: &'a Path,
    known: BTreeMap<String, Option<Arc<Texture>>>,
    left: usize,
}

impl<'a> Images<'a> {
    pub(super) fn new(path: &'a Path) -> Self {
        Self { path, known: BTreeMap::new(), left: MAX_PIXELS }
    }

    /// The image `name`, decoded from what `bytes` gives unless it is known; none, with a warning, where that cannot be.
    pub(super) fn get(
        &mut self,
        name: &str,
        bytes: impl FnOnce() -> Result<Vec<u8>, String>,
    ) -> Option<Arc<Texture>> {
        if let Some(known) = self.known.get(name) {
            return known.clone();
        }
        // Names may be whole `data:` URIs.
        let shown: String = name.chars().take(64).collect();
        let bytes = bytes().map_err(|e| MeshError::texture(self.path, &shown, e));
        let image = bytes.and_then(|bytes| texture::decode(&bytes, self.path, &shown, self.left));
        let image = image.inspect_err(|error| log::warn!("{error}: the mesh is read without it"));
        let image = image.ok().map(Arc::new);
        self.left = self.left.saturating_sub(image.as_ref().map_or(0, |image| image.pixels.len()));
        self.known.insert(name.into(), image.clone());
        image
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
        assert_eq!(images.get("c", || Ok(png.clone())), None);
        assert_eq!(images.get("d", || Err("gone".into())), None);
    }
}
