//! Penalty contact between surface samples of a body and a signed distance field.

pub(crate) mod bristle_function;
pub(crate) mod bristle_law;
pub mod bristles;
pub mod calibration;
pub mod composite;
pub mod contact_query;
pub(crate) mod dimensions;
pub mod dynamic;
pub mod error;
pub(crate) mod force_jump;
pub mod friction;
pub mod gap_smoothing;
pub mod graspd;
pub mod law;
#[cfg(test)]
pub(crate) mod law_checks;
pub(crate) mod moved;
pub mod normal;
pub(crate) mod param_values;
pub mod parameters;
pub mod point;
pub mod range;
pub mod registry;
pub mod restitution;
pub mod wrench;
pub(crate) mod wrench_function;
