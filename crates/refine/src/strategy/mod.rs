//! Ways from an initial pose to a refined one.

mod fused;
mod heuristic;
mod icp;
mod robust_icp;
mod step;
mod trace;
mod walk;

pub use fused::{
    CovarianceInflation, Evidence, Fused, FusedSettings, Hypothesis, Inconsistency, Nuisance,
    Posterior, PosteriorSummary, Stage, Termination, UnobservableDirection,
};
pub(crate) use fused::{Factor, FrameContext, Point, Problem, RIDGE, chi_square_z};
pub use heuristic::{Heuristic, HeuristicSettings};
pub use icp::{Icp, IcpSettings};
pub use robust_icp::{RobustIcp, RobustIcpSettings};
pub(crate) use step::preconditioned_step;
pub use trace::{Iteration, Trace};
