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
            Self::Gpu => match graphics(false) {
                Err(BackendError::NoDevice(_)) => {
                    let software = graphics(true)?;
                    log::warn!("{} is slower than the processor by itself", software.name());
                    Ok(software)
                }
                opened => opened,
            },
            Self::Auto => Ok(graphics(false).unwrap_or_else(|error| {
                match error {
                    BackendError::NoDevice(_) | BackendError::NotBuilt => log::debug!("{error}"),
                    error => log::warn!("{error}; continuing on the CPU"),
                }
                Arc::new(Cpu)
            })),
        }
    }
}

fn unknown(text: &str) -> String {
    format!("no device {text:?}: one of {}", Device::VARIANTS.join(", "))
}

/// Graphics hardware, or a software adapter.
#[cfg(feature = "gpu")]
fn graphics(software: bool) -> Result<Arc<dyn Backend>, BackendError> {
    let gpu = if software { super::Gpu::with_software()? } else { super::Gpu::new()? };
    Ok(Arc::new(gpu))
}

#[cfg(not(feature = "gpu"))]
fn graphics(_: bool) -> Result<Arc<dyn Backend>, BackendError> {
    Err(BackendError::NotBuilt)
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
