//! Penalty contact between surface samples of a body and a signed distance field.

pub mod friction;
pub mod graspd;
pub mod law;
pub mod onset;
pub mod penalty;
pub mod registry;
pub mod stiffness;
pub mod wrench;
