//! Ways from an initial pose to a refined one.

mod heuristic;
mod icp;
mod robust_icp;
mod step;
mod walk;

pub use heuristic::{Heuristic, HeuristicSettings};
pub use icp::{Icp, IcpSettings};
pub use robust_icp::{RobustIcp, RobustIcpSettings};
pub(crate) use step::preconditioned_step;
