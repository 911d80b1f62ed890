//! The loss of a pose, and its derivatives.

use nalgebra::{Matrix6, Vector6};

use super::counts::Counts;
use super::target::Target;

/// The loss of a pose: (1/N) Σ w ρ(r) with the kernel ρ (½ r² where none is asked for) and N three times the area of the
/// target's mask \[px\], so that without further channels it is half the mean squared error over the mask's pixels and color
/// channels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Loss {
    /// Sum of the three below.
    pub total: f64,
    /// Share of the color.
    pub color: f64,
    /// Share of the mask.
    pub mask: f64,
    /// Share of the depth.
    pub depth: f64,
    /// Numbers of pixels.
    pub counts: Counts,
}

impl Loss {
    /// From the sums of color, mask and depth over all pixels of the target.
    pub(crate) fn new([color, mask, depth]: [f64; 3], counts: Counts, target: &Target) -> Self {
        let [color, mask, depth] = [color, mask, depth].map(|sum| sum * target.normalization);
        Self { total: color + mask + depth, color, mask, depth, counts }
    }
}

/// A loss with its derivatives by a left twist of the pose, (translation \[m\], rotation \[rad\]), about a given center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linearized {
    /// The loss.
    pub loss: Loss,
    /// Its gradient, Jᵀ W r / N.
    pub gradient: Vector6<f64>,
    /// Its Gauss–Newton Hessian, Jᵀ W J / N: the step is −`hessian`⁻¹ `gradient`.
    pub hessian: Matrix6<f64>,
}
