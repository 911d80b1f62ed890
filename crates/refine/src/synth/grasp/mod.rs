//! Physically settled grasps and motions of any hand and object, by our own simulator.
//!
//! The object floats before the open hand, whose joints close until the contacts resist; then gravity pulls in several
//! directions, and what does not stay is rejected. Links are moved as they are told (their masses play no part); the object
//! is a rigid body that touches their distance fields by penalty contacts with friction.

mod drive;
mod film;
mod grasper;
mod placement;
mod preshape;
mod self_collision;
mod settings;
mod simulation;
mod skin;
#[cfg(test)]
mod tests;
mod trajectory;

pub use grasper::{Grasp, Grasper};
pub use settings::GraspSettings;
pub use trajectory::GraspSnapshot;
pub(super) use trajectory::Waves;
