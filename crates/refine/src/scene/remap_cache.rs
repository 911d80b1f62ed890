//! Maps from images through a lens to those of a pinhole.

use std::sync::{Arc, Mutex, PoisonError};

use prehend_render::{Camera, Distortion, Remap};

/// Cameras whose maps are kept: that of color and that of depth, which most images of a scene have in common.
const KEPT: usize = 2;

/// Maps to pinhole images of those through a lens, kept for the last cameras.
#[derive(Debug, Default)]
pub(crate) struct RemapCache(Mutex<Vec<(Camera, Distortion, Arc<Remap>)>>);

impl RemapCache {
    /// Map from images of `camera` behind `lens` to those of a pinhole of the same matrix and size.
    pub(crate) fn get(&self, camera: Camera, lens: Distortion) -> Arc<Remap> {
        let kept = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_same = |known: &(Camera, Distortion, _)| (known.0, known.1) == (camera, lens);
        if let Some((.., remap)) = kept().iter().find(|known| is_same(known)) {
            return Arc::clone(remap);
        }
        // Without the lock: a thread that waits for its part of the map may take up another image.
        let remap = Arc::new(Remap::undistort(camera, &lens, camera));
        let mut kept = kept();
        kept.retain(|known| !is_same(known));
        kept.truncate(KEPT - 1);
        kept.insert(0, (camera, lens, Arc::clone(&remap)));
        remap
    }
}
