//! Methods that the estimator is compared with: the paper's heuristic with its factors, and two ICPs. The estimator knows none of them.

mod chamfer_depth;
mod heuristic;
mod icp;
mod robust_icp;
mod stability;
mod step;

pub use self::chamfer_depth::{ChamferDepthFactor, ChamferDepthSettings};
pub use self::heuristic::{GradientKind, Heuristic};
pub use self::icp::Icp;
pub use self::robust_icp::RobustIcp;
pub use self::stability::{StabilityFactor, StabilitySettings};
