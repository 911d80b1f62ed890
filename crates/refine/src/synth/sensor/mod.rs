//! What sensors make of a moment: images, touch, and what is believed of camera, hand and object.

mod background;
mod calibration;
mod color;
mod deformation;
mod depth;
mod field;
mod light;
mod mask;
mod rig;
mod settings;
mod touch;
mod viewpoint;

pub use background::BackgroundSettings;
pub use calibration::CalibrationSettings;
pub use color::ColorSettings;
pub use deformation::ModelSettings;
pub use depth::DepthSettings;
pub(crate) use field::smooth_field;
pub use light::LightSettings;
pub use mask::MaskSettings;
pub(super) use rig::Rig;
pub use settings::{SensorSettings, SettingError};
pub use touch::TouchSettings;
pub use viewpoint::ViewpointSettings;
