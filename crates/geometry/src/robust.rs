//! Losses of one residual that forgive outliers.

use serde::{Deserialize, Serialize};

/// A loss ρ of a squared residual r² that is ½ r² near zero and grows more slowly, or no more, beyond `scale`.
///
/// Forms as in Z. Zhang, "Parameter estimation techniques", 1997, table 1, and J. Barron, "A general and adaptive
/// robust loss function", 2019. `scale` is in the residual's unit, \[m\] for distances, and positive; below 1e-75 and above 1e75 it counts
/// as these.
///
/// ```
/// use prehend_geometry::RobustKernel;
///
/// let cauchy = RobustKernel::Cauchy { scale: 2.0 };
/// assert_eq!(cauchy.weight(0.0), 1.0);
/// assert_eq!(cauchy.weight(4.0), 0.5);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RobustKernel {
    /// ½ r²: every residual counts in full.
    #[default]
    Squared,
    /// ½ r² up to the scale s, then s (r − ½ s).
    Huber {
        /// The residual at which forgiving begins.
        scale: f64,
    },
    /// ½ s² ln(1 + r²/s²).
    Cauchy {
        /// The residual whose weight is one half.
        scale: f64,
    },
    /// ½ r² / (1 + r²/s²): bounded by ½ s².
    GemanMcClure {
        /// The residual whose weight is one quarter.
        scale: f64,
    },
    /// s²/6 (1 − (1 − r²/s²)³) up to s, then constant: outliers count for nothing.
    Tukey {
        /// The residual beyond which the weight is zero.
        scale: f64,
    },
}

impl RobustKernel {
    /// The loss ρ of the squared residual `r2`.
    #[inline]
    pub fn loss(self, r2: f64) -> f64 {
        match self {
            Self::Squared => 0.5 * r2,
            Self::Huber { scale } if r2 <= square(scale) => 0.5 * r2,
            Self::Huber { scale } => in_range(scale) * (r2.sqrt() - 0.5 * in_range(scale)),
            Self::Cauchy { scale } => {
                0.5 * square(scale) * (r2 / square(scale)).min(f64::MAX).ln_1p()
            }
            Self::GemanMcClure { scale } => 0.5 * r2 / (1.0 + r2 / square(scale)),
            Self::Tukey { scale } => {
                let u = (r2 / square(scale)).min(1.0);
                // 1 − (1 − u)³ without cancellation.
                square(scale) / 6.0 * u * (3.0 - u * (3.0 - u))
            }
        }
    }

    /// Twice dρ/dr²: the weight w of a least-squares row, so that the gradient is w r ∂r and the Gauss–Newton
    /// matrix w ∂r ∂rᵀ. Between one and zero.
    #[inline]
    pub fn weight(self, r2: f64) -> f64 {
        match self {
            Self::Squared => 1.0,
            Self::Huber { scale } if r2 <= square(scale) => 1.0,
            Self::Huber { scale } => in_range(scale) / r2.sqrt(),
            Self::Cauchy { scale } => 1.0 / (1.0 + r2 / square(scale)),
            Self::GemanMcClure { scale } => (1.0 + r2 / square(scale)).powi(-2),
            Self::Tukey { scale } => (1.0 - r2 / square(scale)).max(0.0).powi(2),
        }
    }

    /// The scale \[the residual's unit\]; the squared loss has none.
    pub fn scale(self) -> Option<f64> {
        match self {
            Self::Squared => None,
            Self::Huber { scale }
            | Self::Cauchy { scale }
            | Self::GemanMcClure { scale }
            | Self::Tukey { scale } => Some(scale),
        }
    }

    /// The kernel with `factor` times the scale.
    pub fn widened(mut self, factor: f64) -> Self {
        match &mut self {
            Self::Squared => {}
            Self::Huber { scale }
            | Self::Cauchy { scale }
            | Self::GemanMcClure { scale }
            | Self::Tukey { scale } => *scale *= factor,
        }
        self
    }
}

/// A scale within a range that its square, and ratios to that, do not leave for 0 · ∞.
#[inline]
fn in_range(scale: f64) -> f64 {
    scale.clamp(1e-75, 1e75)
}

#[inline]
fn square(scale: f64) -> f64 {
    in_range(scale).powi(2)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Every kernel, at `scale`.
    pub(crate) fn kernels(scale: f64) -> [RobustKernel; 5] {
        [
            RobustKernel::Squared,
            RobustKernel::Huber { scale },
            RobustKernel::Cauchy { scale },
            RobustKernel::GemanMcClure { scale },
            RobustKernel::Tukey { scale },
        ]
    }

    proptest! {
        #[test]
        fn weights_are_derivatives(r in 0.0..3.0_f64, scale in 0.2..2.0_f64) {
            // Where a loss is joined, differences straddle the joint.
            prop_assume!((r - scale).abs() > 1e-3);
            for kernel in kernels(scale) {
                let (r2, h) = (r * r + 1e-3, 1e-5);
                let slope = |f: &dyn Fn(f64) -> f64| (f(r2 + h) - f(r2 - h)) / (2.0 * h);
                let weight = 2.0 * slope(&|x| kernel.loss(x));
                prop_assert!((weight - kernel.weight(r2)).abs() < 1e-7, "{:?}", kernel);
            }
        }
    }

    #[test]
    fn all_agree_with_the_square_at_zero_and_none_exceeds_it() {
        for kernel in kernels(0.3) {
            assert_eq!((kernel.loss(0.0), kernel.weight(0.0)), (0.0, 1.0));
            assert!((kernel.loss(1e-12) - 0.5e-12).abs() < 1e-22, "{kernel:?}");
            for r in [0.01, 0.2, 0.3, 0.31, 5.0_f64] {
                assert!(kernel.loss(r * r) <= 0.5 * r * r * (1.0 + 1e-15), "{kernel:?}");
                assert!((0.0..=1.0).contains(&kernel.weight(r * r)));
            }
        }
        assert_eq!(RobustKernel::Tukey { scale: 0.3 }.weight(1.0), 0.0);
        let far = [0.09_f64, 100.0].map(|r2| RobustKernel::Tukey { scale: 0.3 }.loss(r2));
        assert!((far[0] - far[1]).abs() < 1e-16);
    }
}
