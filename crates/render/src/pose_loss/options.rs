//! Terms of the loss of a pose.

use prehend_geometry::RobustKernel;

/// Terms of a [`PoseLoss`](super::PoseLoss), whatever the mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LossOptions {
    /// Weight of the squared color difference a channel. Zero leaves it out.
    pub color_weight: f64,
    /// Weight of the squared difference between the object's coverage (0..=1) and the mask, relative to one
    /// color channel of weight one. Zero leaves it out.
    pub mask_weight: f64,
    /// Comparison of depth, if the target has any.
    pub depth: Option<DepthOptions>,
    /// Loss of a color difference; its scale is in units of color.
    pub kernel: RobustKernel,
    /// Cost of a pixel of the mask where a known body lies in front of the rendered object: `false` gives it no
    /// residual. `true` costs as much as a pixel that the object misses: hiding behind the body does not lower the loss.
    /// Neither has a derivative.
    pub penalize_occluded: bool,
}

impl Default for LossOptions {
    /// Half the mean squared error of the color alone.
    fn default() -> Self {
        Self {
            color_weight: 1.0,
            mask_weight: 0.0,
            depth: None,
            kernel: RobustKernel::Squared,
            penalize_occluded: false,
        }
    }
}

/// How depth enters the loss: as `½ weight (dz / scale)²` where both depths exist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthOptions {
    /// Weight relative to one color channel.
    pub weight: f64,
    /// Depth difference that counts as one unit \[m\].
    pub scale: f64,
    /// Larger differences count as this one and pull no more \[m\]; infinite for none.
    pub truncation: f64,
}
