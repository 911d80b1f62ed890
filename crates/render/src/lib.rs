//! Rendering with exact derivatives by the object's pose, and plain pictures.
//!
//! [`ContourRenderer`] compares a posed [`RenderModel`] with a segmented image and returns the loss, its
//! gradient and the Gauss–Newton matrix by the six degrees of freedom of the pose. [`render_scene`] makes
//! pictures, [`depth_map`] the z-buffer of what hides the object.
//!
//! Cameras follow OpenCV (x right, y down, z forward; pixel centres at integers); lengths are in metres; colours
//! are in 0..=1 as stored in files.

pub mod camera;
pub mod contour;
pub mod image;
pub mod light;
pub mod model;
pub mod overlay;
mod posed;
mod raster;
pub mod scene;
#[cfg(test)]
mod shapes_for_tests;

pub use camera::{Camera, CameraError};
pub use contour::{
    ContourImage, ContourOptions, ContourRenderer, Counts, DepthOptions, Linearised, Loss, Robust,
    Target, TargetError,
};
pub use image::{DepthImage, ImageError, Mask, RgbImage};
pub use light::{Light, LightError, LightSample};
pub use model::{ModelError, RenderModel};
pub use overlay::draw_outline;
pub use raster::depth_map;
pub use scene::{SceneImage, SceneObject, render_scene};
