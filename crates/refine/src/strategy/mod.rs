//! Ways from an initial pose to a refined one.

mod fused;
mod heuristic;
mod icp;
mod robust_icp;
mod step;
mod walk;

pub use fused::{
    Confidence, ConfidenceSummary, Disagreement, Ending, Evidence, Fused, FusedSettings,
    Hypothesis, Nuisance, Stage, Unobserved, Width,
};
pub(crate) use fused::{Factor, Known, Point, Problem, RIDGE, beyond_chance};
pub use heuristic::{Heuristic, HeuristicSettings};
pub use icp::{Icp, IcpSettings};
pub use robust_icp::{RobustIcp, RobustIcpSettings};
pub(crate) use step::preconditioned_step;
