//! What there is: one [`Observation`], the [`Object`] whose pose is sought, the [`Hand`] that holds it, and the errors of the camera.

mod calibration;
mod correction;
mod example;
mod frame;
mod hand;
mod inducing_points;
mod inspect;
mod object;
mod observation;
mod region;
mod remap_cache;
mod sensing;
mod sequence;
mod surface_deviation;
mod target;
mod touch;
mod view;

pub use calibration::{CameraCalibrationError, ViewCalibrationError};
pub use correction::{
    Correction, CorrectionSettings, CorrectionTrial, FieldNames, Finding, find_corrections,
};
pub use example::{Scene, default_scene};
pub use frame::{CameraView, Frame, Occluders};
pub(crate) use frame::{MASK_MARGIN, draw_hand_depth, eroded};
pub use hand::Hand;
pub(crate) use inducing_points::far_apart;
pub use inspect::{Subject, Warning};
pub(crate) use inspect::{inspect_object, inspect_pose, likely_unit};
pub use object::{Inertial, Object, StatedSize};
pub use observation::{AdditionalView, HandMeasurement, Observation, check_gravity};
pub use region::ForegroundSettings;
pub(crate) use region::{ColorRatios, MaskBorder, RegionColors, RegionEvidence, color_index};
pub(crate) use remap_cache::RemapCache;
pub use sequence::{Sequence, SequenceFrame, default_sequence};
pub use surface_deviation::{ModelErrorSettings, SurfaceDeviation};
pub use target::Target;
pub use touch::{BinaryContact, ContactPatch, ProximityReading, TouchReading};
pub(crate) use view::{Pixel, View, median};
