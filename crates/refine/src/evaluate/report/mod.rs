//! Pictures of a run for people: before and after, loss curves, and one page that shows them all.

#[cfg(feature = "cli")]
mod curves;
#[cfg(feature = "cli")]
mod page;
mod picture;

#[cfg(feature = "cli")]
pub use page::{FrameReport, Report};
pub use picture::{before_and_after, depth_residual_picture, outline_picture, rig_picture};
