//! Rendering with exact derivatives by the object's pose, and plain pictures.
//!
//! [`PoseLoss`] compares a posed [`RenderModel`] with a segmented image and returns the loss, its
//! gradient and the Gauss–Newton matrix by the six degrees of freedom of the pose, in either [`Mode`]; a [`Backend`] does so for
//! thousands of poses at once, on this processor or a graphics device ([`Device`]). [`Renderer`] renders
//! whole scenes under any [`Shader`] and carries the derivatives of any loss back to poses, vertices, colors, textures,
//! camera and light, on the tape too. [`render_scene`] makes antialiased pictures, [`depth_map`] the z-buffer of what hides
//! the object, and [`Remap`] pinhole images of those through a lens.
//!
//! Cameras follow OpenCV (x right, y down, z forward; pixel centers at integers); lengths are in meters; colors
//! are in 0..=1 as stored in files. Poses and cameras of graphics engines, in glam's types, are converted by [`graphics`].

#![cfg_attr(docsrs, feature(doc_cfg))]

mod backend;
pub mod camera;
mod contour;
pub mod distortion;
mod exif;
pub mod graphics;
pub mod image;
pub mod light;
mod look_at;
mod mode;
pub mod model;
mod outline;
pub mod overlay;
mod pose_loss;
mod posed;
mod precision;
mod projected;
mod raster;
mod registration;
mod renderer;
pub mod scene;
pub mod shading;
#[cfg(test)]
mod shapes_for_tests;
mod softras;
mod view;

pub use glam;

#[cfg(feature = "gpu")]
pub use backend::Gpu;
pub use backend::{Backend, BackendError, Cpu, Device, Hypothesis, PoseProblem, Session};
pub use camera::{Camera, CameraError};
pub use distortion::{BrownConrady, Distortion, DistortionError, KannalaBrandt, Remap};
pub use graphics::{MatrixError, ModelView};
pub use image::{DepthImage, ImageError, Mask, RgbImage, image_size};
pub use light::{Light, LightError, LightSample};
pub use look_at::look_at;
pub use mode::{ContourOptions, Mode, SoftRasOptions};
pub use model::{ModelError, RenderModel};
pub use outline::{OutlinePoint, outline_points};
pub use overlay::draw_outline;
pub use pose_loss::{
    Counts, DepthOptions, Linearized, Loss, LossOptions, OptionError, PoseImage, PoseLoss, Target,
    TargetError, Tile, light_samples,
};
pub use raster::{depth_map, draw_depth};
pub use registration::register_depth;
pub use renderer::{
    BufferAdjoints, BufferVars, Buffers, FaceId, ObjectGradient, PosedModel, RecordError, Renderer,
    Rendering, Scene, SceneGradient, SceneVars, render_each, vjp_each,
};
pub use scene::{SceneImage, render_scene};
pub use shading::{Lamp, Lighting, Material, Shader, SurfacePoint};
