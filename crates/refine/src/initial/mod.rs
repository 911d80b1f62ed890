//! Poses to refine from: the truth with noise, as studies start from, and a search by sensors alone.
//!
//! [`NoiseLevel`] moves a true pose as wrong as a vision system would have it. [`PoseSearch`] needs no pose at all:
//! from depth, mask, touch and color it finds the pose of a known object by trying very many.

mod noise;
mod search;
mod targets;

pub use noise::NoiseLevel;
pub use search::{Found, PoseSearch, SearchSettings};
pub use targets::{Target, find_targets};
