//! Graphics devices: compute shaders on Vulkan, Metal or DirectX 12.
//!
//! All hypotheses of a call go through the same passes at once: project the vertices, sort the faces into tiles of 8 by 8
//! pixels (count, scan, scatter), fill the z-buffer, find silhouette edges and cut them into visible pieces, and compute the
//! residuals with one thread a pixel. Each tile's sums are added up in a fixed order, then those of each hypothesis, or of
//! each square of the image by which sums are asked for. Lists that atomics fill in any order are only searched for minima
//! with unique keys, so that results repeat to the bit. Only the sums come back.

mod answer;
mod device;
mod layout;
mod passes;
mod readback;
mod session;
mod shaders;
#[cfg(test)]
mod tests;
mod upload;
mod work;

use std::sync::Arc;

use super::{Backend, BackendError, PoseProblem, Session};
use device::Device;

/// A graphics device. Cheap to clone; sessions of all clones share the compiled passes.
#[derive(Clone)]
pub struct Gpu {
    device: Arc<Device>,
}

impl Gpu {
    /// The best hardware adapter.
    ///
    /// # Errors
    /// When there is none, or it cannot be opened.
    pub fn new() -> Result<Self, BackendError> {
        Ok(Self { device: Arc::new(Device::open(false)?) })
    }

    /// A software adapter such as Mesa's lavapipe if there is one, else as [`Gpu::new`]: for tests, not for speed.
    ///
    /// # Errors
    /// When there is no adapter at all, or it cannot be opened.
    pub fn with_software() -> Result<Self, BackendError> {
        Ok(Self { device: Arc::new(Device::open(true)?) })
    }
}

impl std::fmt::Debug for Gpu {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Gpu").field(&self.device.name).finish()
    }
}

impl Backend for Gpu {
    fn name(&self) -> &str {
        &self.device.name
    }

    fn prepare(&self, problem: &PoseProblem) -> Result<Box<dyn Session>, BackendError> {
        Ok(Box::new(session::GpuSession::new(self.device.clone(), problem)?))
    }
}
