//! Pictures of a run for people, and one page that shows them all.

#[cfg(feature = "cli")]
mod document;
#[cfg(feature = "cli")]
mod frame;
#[cfg(feature = "cli")]
mod page;
mod picture;
#[cfg(feature = "cli")]
mod scene;

#[cfg(feature = "cli")]
pub use document::{Chart, Column, Figure, Series};
#[cfg(feature = "cli")]
pub use frame::{DrawnFrame, FrameDrawing, FrameReport};
#[cfg(feature = "cli")]
pub use page::Report;
pub use picture::{before_and_after, depth_residual_picture, outline_picture, rig_picture};
