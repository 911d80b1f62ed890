//! Closed procedural shapes: every mesh is watertight once welded by position, and faces outward.

mod boxes;
#[cfg(test)]
pub(crate) mod closed;
mod loft;
mod mug;
mod round;
mod tube;

pub use boxes::{BoxFace, Panel, RoundedBox, cuboid, rounded_box};
pub use loft::{Section, loft, meridian_lengths, smoothed, subdivided};
pub use mug::Mug;
pub use round::{capsule, cone, cylinder, revolve, sphere, superellipsoid};
pub use tube::tube;
