//! Pictures of a run for people: before and after, loss curves, and one page that shows them all.

mod curves;
mod page;
mod picture;

pub use page::{Report, ReportError};
pub use picture::{FrameReport, before_and_after, outline_picture};
