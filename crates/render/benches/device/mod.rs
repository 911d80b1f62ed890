//! The device that is timed beside the processor.

use std::sync::Arc;

use prehend_render::{Backend, BackendError, Device};

/// Graphics hardware if there is any, else the processor; with `PREHEND_SOFTWARE_GPU=1` a software device such as Mesa's lavapipe.
pub(crate) fn device() -> Result<Arc<dyn Backend>, BackendError> {
    #[cfg(feature = "gpu")]
    if std::env::var("PREHEND_SOFTWARE_GPU").is_ok_and(|v| v == "1") {
        return Ok(Arc::new(prehend_render::Gpu::with_software()?));
    }
    Device::Auto.open()
}
