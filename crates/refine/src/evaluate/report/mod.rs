//! Pictures of a run for people, and one page that shows them all.

#[cfg(feature = "cli")]
mod page;
mod picture;

#[cfg(feature = "cli")]
pub use page::{
    Chart, Column, DrawnFrame, FrameDrawing, FrameReport, Report, Series, flags, least_sure,
    pose_figures,
};
pub use picture::{before_and_after, depth_residual_picture, outline_picture, rig_picture};
