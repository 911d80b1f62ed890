//! Methods that the estimator is compared with: the paper's heuristic with its factors, and two ICPs. The estimator knows none of them.

mod chamfer_depth;
mod heuristic;
mod icp;
mod matcher;
mod stability;
mod stability_loss;
mod step;

pub use self::chamfer_depth::{ChamferDepthFactor, ChamferDepthSettings};
pub use self::heuristic::{GradientKind, Heuristic};
pub use self::icp::Icp;
pub(crate) use self::icp::IcpMetric;
pub use self::stability::{StabilityFactor, StabilitySettings};

use prehend_geometry::RobustKernel;

use crate::factor::{RenderingSettings, TactileSettings, TouchModel};
use crate::problem::{CAUCHY_WIDTH, NoiseModel};
use crate::scene::Occluders;

/// Residuals of standard deviation `sigma` with Cauchy's kernel of this `width`, wide enough for steps from far away: there is no way from coarse to fine.
fn wide(sigma: f64, width: f64, effective_samples: f64) -> NoiseModel {
    NoiseModel { sigma, kernel: RobustKernel::Cauchy { scale: width }, effective_samples }
}

/// Color and silhouette as the paper has them: what hides the object is the hand, and nothing else.
fn rendering_settings() -> RenderingSettings {
    RenderingSettings {
        downsample: 2,
        occluders: Occluders::Hand,
        mask_sigma: 0.3,
        kernel_scale: 2.0 / CAUCHY_WIDTH,
        effective_pixels: 200.0,
        ..RenderingSettings::default()
    }
}

/// Touch as the paper has it: every touched taxel is on the surface.
fn tactile_settings() -> TactileSettings {
    let touch = TouchModel::Taxels(wide(3e-3, 10e-3, 8.0));
    let no_contact = wide(1e-3, 10e-3, f64::INFINITY);
    TactileSettings { touch, no_contact, ..TactileSettings::default() }
}
