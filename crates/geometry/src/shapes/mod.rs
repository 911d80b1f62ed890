//! Closed procedural shapes: every mesh is watertight once welded by position, and faces outward.

mod boxes;
#[cfg(test)]
pub(crate) mod closed;
mod loft;
mod round;

pub use boxes::{BoxFace, Panel, RoundedBox, cuboid, rounded_box};
pub use loft::{Section, loft, meridian_lengths, smoothed, subdivided};
pub use round::{capsule, cylinder, revolve, sphere, superellipsoid};
