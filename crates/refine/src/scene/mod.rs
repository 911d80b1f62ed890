//! The scene: one [`Frame`], the [`Object`] whose pose is sought, the [`Hand`] that holds it, and the errors of the camera.

mod calibration;
mod example;
mod frame;
mod gaussian_process;
mod hand;
mod intrinsics;
mod object;
mod prepared_frame;
mod region;
mod remap_cache;
mod sums;
mod surface_deviation;
mod target;
mod touch;
mod view;

pub use calibration::{CameraCalibrationError, ViewCalibrationError};
pub use example::{Scene, Sequence, SequenceFrame, default_scene, default_sequence};
pub use frame::{AdditionalView, Frame, HandMeasurement, check_gravity};
pub(crate) use gaussian_process::{InducingPoints, farthest_points, squared_exponential};
pub use hand::Hand;
pub(crate) use hand::prismatic_joints;
pub(crate) use intrinsics::IntrinsicsMistake;
pub(crate) use object::StatedSize;
pub use object::{Inertial, Object};
pub(crate) use prepared_frame::CameraView;
pub(crate) use prepared_frame::{MASK_MARGIN, draw_hand_depth, eroded, hand_depth};
pub use prepared_frame::{Occluders, PreparedFrame};
pub use region::ForegroundSettings;
pub(crate) use region::{
    ColorRatios, MaskBorder, RegionColors, RegionEvidence, color_index, pixel_distances,
};
pub(crate) use remap_cache::RemapCache;
pub(crate) use sums::{BoxSums, squares};
pub use surface_deviation::{ModelErrorSettings, SurfaceDeviation};
pub use target::Target;
pub use touch::{BinaryContact, ContactPatch, ProximityReading, TouchReading};
pub(crate) use view::{Pixel, View, median};
