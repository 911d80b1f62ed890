//! Which device renders.

use std::sync::Arc;

use strum::{Display, EnumString, VariantNames};

use super::{Backend, BackendError, Cpu};

/// Which device renders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Display, EnumString, VariantNames)]
#[strum(serialize_all = "lowercase", parse_err_ty = String, parse_err_fn = unknown)]
pub enum Device {
    /// The processor at hand.
    #[default]
    Cpu,
    /// A graphics device: hardware if there is any, else a software adapter such as Mesa's lavapipe, which is slower than
    /// [`Device::Cpu`]. Needs the cargo feature `gpu`.
    Gpu,
    /// Graphics hardware if there is any and the cargo feature `gpu` is on, else the processor.
    Auto,
}

impl Device {
    /// The device, open and ready.
    ///
    /// Opening a graphics device and compiling its shaders takes some tenths of a second: call this once.
    ///
    /// # Errors
    /// For [`Device::Gpu`], when there is no device, it cannot be opened, or this program was built without graphics.
    pub fn open(self) -> Result<Arc<dyn Backend>, BackendError> {
        match self {
            Self::Cpu => Ok(Arc::new(Cpu)),
            Self::Gpu => gpu(),
            Self::Auto => Ok(hardware().unwrap_or_else(|| Arc::new(Cpu))),
        }
    }
}

fn unknown(text: &str) -> String {
    format!("no device {text:?}: one of {}", Device::VARIANTS.join(", "))
}

#[cfg(feature = "gpu")]
fn gpu() -> Result<Arc<dyn Backend>, BackendError> {
    use super::Gpu;

    let gpu = Gpu::new().or_else(|error| match error {
        BackendError::NoDevice(_) => {
            let software = Gpu::with_software()?;
            log::warn!("{} is slower than the processor by itself", software.name());
            Ok(software)
        }
        error => Err(error),
    })?;
    Ok(Arc::new(gpu))
}

#[cfg(not(feature = "gpu"))]
fn gpu() -> Result<Arc<dyn Backend>, BackendError> {
    Err(BackendError::NotBuilt)
}

#[cfg(feature = "gpu")]
fn hardware() -> Option<Arc<dyn Backend>> {
    use super::Gpu;

    match Gpu::new() {
        Ok(gpu) => return Some(Arc::new(gpu)),
        Err(BackendError::NoDevice(reason)) => log::debug!("no graphics device: {reason}"),
        Err(error) => log::warn!("{error}; continuing on the CPU"),
    }
    None
}

#[cfg(not(feature = "gpu"))]
fn hardware() -> Option<Arc<dyn Backend>> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_are_told_by_their_names() {
        for name in Device::VARIANTS {
            assert_eq!(name.parse::<Device>().unwrap().to_string(), *name);
        }
        assert_eq!(
            "vulkan".parse::<Device>().unwrap_err(),
            "no device \"vulkan\": one of cpu, gpu, auto"
        );
        assert_eq!(Device::default().open().unwrap().name(), "CPU");
    }

    #[test]
    #[cfg(not(feature = "gpu"))]
    fn a_build_without_graphics_says_so() {
        assert_eq!(Device::Gpu.open().err(), Some(BackendError::NotBuilt));
        assert_eq!(Device::Auto.open().unwrap().name(), "CPU");
    }
}
