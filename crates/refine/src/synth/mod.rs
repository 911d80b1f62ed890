//! Made-up frames whose truth is known: to try things on, and to test with.

mod annotation;
mod dataset;
mod grasp;
mod moment;
mod scene;
mod sensing;

pub use dataset::write_dataset;
pub use grasp::{Grasp, GraspError, GraspFault, GraspSettings, Grasper, Preshape};
pub use moment::Moment;
pub use scene::{Scene, default_scene};
