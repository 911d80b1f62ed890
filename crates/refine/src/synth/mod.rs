//! Made-up frames whose truth is known: to try things on, and to test with.

mod annotation;
mod dataset;
mod scene;
mod sensing;

pub use dataset::write_dataset;
pub use scene::{Scene, default_scene};
