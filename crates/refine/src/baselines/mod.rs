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
use crate::factor::{RenderingSettings, TactileSettings, TouchModel};
use crate::problem::NoiseModel;
use crate::scene::Occluders;

/// Color and silhouette as the paper has them: what hides the object is the hand, and nothing else.
fn rendering_settings() -> RenderingSettings {
    RenderingSettings {
        downsample: 2,
        occluders: Occluders::Hand,
        mask_sigma: 0.3,
        effective_pixels: 200.0,
        ..RenderingSettings::default()
    }
}

/// Touch as the paper has it: every touched taxel is on the surface.
fn tactile_settings() -> TactileSettings {
    let touch = TouchModel::Taxels(NoiseModel::cauchy(3e-3, 8.0));
    TactileSettings { touch, ..TactileSettings::default() }
}
