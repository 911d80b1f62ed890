//! Cache of distance grids, kept between runs.

use std::path::PathBuf;

use etcetera::BaseStrategy;
use prehend_geometry::GridCache;

/// The cache in the folder that `PREHEND_CACHE` names, none if that is empty, and by default in `prehend` in the user's cache
/// folder.
pub fn user_cache() -> Option<GridCache> {
    let folder = match std::env::var_os("PREHEND_CACHE") {
        Some(folder) => PathBuf::from(folder),
        None => etcetera::choose_base_strategy().ok()?.cache_dir().join("prehend"),
    };
    log::debug!("cache folder: {folder:?}");
    (!folder.as_os_str().is_empty()).then(|| GridCache::new(folder))
}
