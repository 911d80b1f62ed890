//! Maps from images through a lens to those of a pinhole.

use std::sync::{Arc, Mutex, PoisonError};

use prehend_render::{Camera, Distortion, Remap};

/// Map to pinhole images of those through a lens, kept for the last camera: most images of a scene have the same one.
#[derive(Debug, Default)]
pub(crate) struct RemapCache(Mutex<Option<(Camera, Distortion, Arc<Remap>)>>);

impl RemapCache {
    /// Of images of `camera` behind `lens`, for a pinhole of the same matrix and size.
    pub(crate) fn get(&self, camera: Camera, lens: Distortion) -> Arc<Remap> {
        let last = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((known, its, remap)) = &*last()
            && (*known, *its) == (camera, lens)
        {
            return Arc::clone(remap);
        }
        // Without the lock: a thread that waits for its part of the map may take up another image.
        let remap = Arc::new(Remap::undistort(camera, &lens, camera));
        *last() = Some((camera, lens, Arc::clone(&remap)));
        remap
    }
}
