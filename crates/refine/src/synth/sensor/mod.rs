//! Sensor models: images, taxels, calibration errors of camera and hand, and errors of the object model.

mod background;
mod calibration;
mod color;
mod deformation;
mod depth;
mod film;
mod lens;
mod light;
mod mask;
mod rig;
mod settings;
mod smooth_field;
mod touch;
mod viewpoint;

pub use film::FilmSettings;
pub(super) use lens::SimulatedLens;
pub(super) use rig::SensorRig;
pub use settings::SensorSettings;
#[cfg(feature = "cli")]
pub(crate) use smooth_field::smooth_field;
