//! How residuals scatter.

use std::collections::BTreeMap;

use prehend_geometry::RobustKernel;
use serde::{Deserialize, Serialize};

/// How the residuals of a factor scatter: what makes costs in nats of residuals.
///
/// n residuals r cost min(1, m/n) / σ² · Σ ρ(r²), where ρ is the kernel's loss (½ r² without one) and m the number of
/// independent measurements that they amount to at most.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct NoiseModel {
    /// Standard deviation σ of a residual \[the residual's unit\]; infinite for one that says nothing.
    pub sigma: f64,
    /// Robust kernel, which forgives outliers; its width is in the residual's unit, and is not changed with σ.
    #[cfg_attr(feature = "cli", schemars(with = "serde_json::Value"))]
    pub kernel: RobustKernel,
    /// Effective sample size m: errors of neighbors are alike, so that thousands of residuals are not thousands of witnesses.
    pub effective_samples: f64,
}

/// Width of Cauchy's kernel in standard deviations with which estimates from normal errors are 95 % as efficient as least squares (Holland and
/// Welsch, 1977).
pub const CAUCHY_WIDTH: f64 = 2.385;

impl NoiseModel {
    /// Independent residuals of standard deviation `sigma`, normally distributed.
    pub fn gaussian(sigma: f64) -> Self {
        Self { sigma, kernel: RobustKernel::Squared, effective_samples: f64::INFINITY }
    }

    /// Residuals of standard deviation `sigma` with outliers, forgiven by Cauchy's kernel of width [`CAUCHY_WIDTH`]; they amount to at most
    /// `effective_samples` independent ones.
    pub fn cauchy(sigma: f64, effective_samples: f64) -> Self {
        let kernel = RobustKernel::Cauchy { scale: CAUCHY_WIDTH * sigma };
        Self { sigma, kernel, effective_samples }
    }

    /// With this standard deviation, and a kernel of as many of them as before.
    pub(crate) fn with_sigma(self, sigma: f64) -> Self {
        Self { sigma, ..self.widened(sigma / self.sigma) }
    }

    /// With a kernel `factor` times as wide: graduated non-convexity (Blake and Zisserman, 1987).
    pub fn widened(self, factor: f64) -> Self {
        Self { kernel: self.kernel.widened(factor), ..self }
    }

    /// The weight of one of `count` residuals; the number matters only where they amount to fewer independent ones.
    pub fn weighting(&self, count: usize) -> Weighting {
        let independent = (self.effective_samples / count.max(1) as f64).min(1.0);
        let information = independent / self.sigma.powi(2);
        Weighting { information, kernel: self.kernel, degrees: independent }
    }
}

/// Information, kernel and degrees of freedom of a residual.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighting {
    /// Information η/σ², η = min(1, n_eff/n) \[nat per half a squared unit of the residual\].
    pub information: f64,
    /// Robust kernel.
    pub kernel: RobustKernel,
    /// How many independent measurements the residual amounts to.
    pub degrees: f64,
}

impl Weighting {
    /// The cost of the residual `r` \[nat\].
    #[inline]
    pub fn cost(&self, r: f64) -> f64 {
        self.information * self.kernel.loss(r * r)
    }

    /// The weight w of the residual `r` in iteratively reweighted least squares: gradient w r ∂r, Hessian w ∂r ∂rᵀ.
    #[inline]
    pub fn weight(&self, r: f64) -> f64 {
        self.information * self.kernel.weight(r * r)
    }

    /// True of a residual that counts at least half of what one of zero does.
    pub(crate) fn is_inlier(&self, r: f64) -> bool {
        self.kernel.weight(r * r) >= 0.5 * self.kernel.weight(0.0)
    }

    /// Weighting of a residual whose information and degrees of freedom are `share` of these.
    pub(crate) fn shared(&self, share: f64) -> Self {
        let (information, degrees) = (share * self.information, share * self.degrees);
        Self { information, degrees, ..*self }
    }
}

/// Scales of the factors' noise, by name.
pub(crate) type NoiseScales = BTreeMap<&'static str, NoiseScale>;

/// The scale of a factor's noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NoiseScale {
    /// By which the standard deviation is larger than usual.
    pub(crate) scale: f64,
    /// Negative logarithm of its prior density and of the residuals' normalization, less that at a scale of one \[nat\].
    pub(crate) cost: f64,
}

impl NoiseScale {
    pub(crate) const ONE: Self = Self { scale: 1.0, cost: 0.0 };

    /// Weight of costs, scale⁻².
    pub(super) fn weight(&self) -> f64 {
        self.scale.powi(-2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_residuals_amount_to_the_effective_number() {
        let noise = NoiseModel::cauchy(2e-3, 10.0);
        assert_eq!(noise.weighting(5).information, 2e-3f64.powi(-2));
        assert_eq!(noise.weighting(40).information, 0.25 * 2e-3f64.powi(-2));
        assert_eq!(NoiseModel::gaussian(f64::INFINITY).weighting(3).cost(1.0), 0.0);
    }

    #[test]
    fn a_wider_kernel_forgives_less() {
        let noise = NoiseModel::cauchy(1.0, f64::INFINITY);
        let wide = noise.widened(4.0).weighting(1);
        let far = 4.0 * CAUCHY_WIDTH;
        assert_eq!(wide.weight(far), 0.5);
        assert!(wide.cost(far) > noise.weighting(1).cost(far));
    }
}
