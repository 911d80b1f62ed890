//! Penalty contact between surface samples of a body and a signed distance field.

pub mod approach;
mod built_in;
mod error;
pub mod friction;
pub mod grain;
pub mod graspd;
pub mod hertz;
pub mod hunt_crossley;
pub mod law;
#[cfg(test)]
pub(crate) mod law_checks;
pub mod onset;
pub mod patch;
pub mod penalty;
pub mod registry;
pub mod resting;
pub mod restitution;
pub mod stribeck;
pub mod wrench;

pub use error::LawError;
