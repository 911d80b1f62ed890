//! Rendering with exact derivatives by the object's pose, and plain pictures.
//!
//! [`PoseLoss`] compares a posed [`RenderModel`] with a segmented image and returns the loss, its
//! gradient and the Gauss–Newton matrix by the six degrees of freedom of the pose, in either [`Mode`]. [`render_scene`] makes
//! pictures, [`depth_map`] the z-buffer of what hides the object.
//!
//! Cameras follow OpenCV (x right, y down, z forward; pixel centres at integers); lengths are in metres; colours
//! are in 0..=1 as stored in files.

pub mod backend;
pub mod camera;
mod contour;
pub mod image;
pub mod light;
mod mode;
pub mod model;
pub mod overlay;
mod pose_loss;
mod posed;
mod projected;
mod raster;
pub mod scene;
#[cfg(test)]
mod shapes_for_tests;
mod softras;

#[cfg(feature = "gpu")]
pub use backend::Gpu;
pub use backend::{Backend, BackendError, Cpu, Hypothesis, PoseProblem, Session};
pub use camera::{Camera, CameraError};
pub use contour::light_samples;
pub use image::{DepthImage, ImageError, Mask, RgbImage};
pub use light::{Light, LightError, LightSample};
pub use mode::{ContourOptions, Mode, SoftRasOptions};
pub use model::{ModelError, RenderModel};
pub use overlay::draw_outline;
pub use pose_loss::{
    Counts, DepthOptions, Linearised, Loss, LossOptions, PoseImage, PoseLoss, Robust, Target,
    TargetError,
};
pub use raster::depth_map;
pub use scene::{SceneImage, SceneObject, render_scene};
