//! Where preparations are kept between runs.

use std::env;
use std::path::PathBuf;

use etcetera::BaseStrategy;
use prehend_geometry::GridCache;

/// The folder that `PREHEND_CACHE` names, none if that is empty, and by default `prehend` in the user's cache folder.
pub(crate) fn open() -> Option<GridCache> {
    let folder = match env::var_os("PREHEND_CACHE") {
        Some(folder) => PathBuf::from(folder),
        None => etcetera::choose_base_strategy().ok()?.cache_dir().join("prehend"),
    };
    (!folder.as_os_str().is_empty()).then(|| GridCache::new(folder))
}
