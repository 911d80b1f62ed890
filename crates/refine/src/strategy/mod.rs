//! Ways from an initial pose to a refined one.

mod heuristic;

pub use heuristic::{Heuristic, HeuristicSettings};
