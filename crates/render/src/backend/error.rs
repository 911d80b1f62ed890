//! Errors of devices.

use crate::pose_loss::OptionError;

/// Why a device did not answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BackendError {
    /// There is no device of the kind asked for.
    #[error("no graphics device: {0}")]
    NoDevice(String),
    /// The program was built without graphics devices.
    #[error(
        "this program was built without graphics devices: build it with the cargo feature `gpu`"
    )]
    NotBuilt,
    /// A setting of the loss is out of its range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// The device was lost or its driver failed.
    #[error("{device}: {reason}")]
    Device {
        /// The device's name.
        device: String,
        /// The error of the driver.
        reason: String,
    },
    /// The problem does not fit the device.
    #[error("{device}: {what} needs {needed} bytes, at most {limit} are allowed")]
    TooLarge {
        /// The device's name.
        device: String,
        /// Name of the data or dispatch that is too large.
        what: &'static str,
        /// Bytes needed.
        needed: u64,
        /// Bytes the device allows.
        limit: u64,
    },
    /// The device's passes do not know an option.
    #[error("{device} does not support {what}")]
    Unsupported {
        /// The device's name.
        device: String,
        /// The option.
        what: &'static str,
    },
}
