//! How contact begins: the map from gap to effective gap, and its derivative.

/// The map x ↦ effective gap that precedes a contact law, for the gap x beyond the law's reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Onset {
    /// min(x, 0).
    Hard,
    /// −ε ln(1 + exp(−x/ε)): smooth, and a real function, so its derivatives are those of the forces.
    Softplus {
        /// ε \[m\], positive. At least 0.65 |v_n| dt keeps gradients through impacts right.
        width: f64,
    },
    /// [`Onset::Hard`] in value; its derivative where inactive is `alpha` instead of zero, so that
    /// contacts not yet made are felt by gradients (and by gradients only).
    Leaky {
        /// Derivative where inactive, usually 0.1.
        alpha: f64,
        /// Distance \[m\] within which inactive contacts leak. Without a band (infinity) distant
        /// surfaces dominate, and gradients of longer rollouts can point the wrong way.
        band: f64,
        /// Steps of a rollout on which contacts leak.
        steps: LeakSteps,
    },
}

/// Steps of a rollout on which inactive contacts leak.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum LeakSteps {
    /// Every step.
    All,
    /// The first step only.
    First,
}

/// An onset at one gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnsetSample {
    /// Effective gap \[m\], at most zero.
    pub gap: f64,
    /// What gradients use for d gap / dx: the true derivative, except where leaky.
    pub slope: f64,
    /// True derivative d gap / dx, by which gap rates are scaled, in 0..=1.
    pub activation: f64,
    /// d activation / dx \[1/m\].
    pub activation_slope: f64,
}

/// exp(−30) of a softplus is below what a sum of forces can resolve.
const SOFTPLUS_CUTOFF: f64 = 30.0;

impl Onset {
    /// Beyond this gap value and derivative are zero \[m\].
    #[inline]
    pub fn band(&self) -> f64 {
        match *self {
            Self::Hard => 0.0,
            Self::Softplus { width } => SOFTPLUS_CUTOFF * width,
            Self::Leaky { band, .. } => band,
        }
    }

    /// The onset to use at step number `index` of a rollout.
    #[inline]
    pub fn at_step(&self, index: usize) -> Self {
        match self {
            Self::Leaky { steps: LeakSteps::First, .. } if index > 0 => Self::Hard,
            other => *other,
        }
    }

    /// The onset at gap `x` \[m\], or `None` where value and derivative are zero.
    #[inline]
    pub fn at(&self, x: f64) -> Option<OnsetSample> {
        let hard = OnsetSample { gap: x, slope: 1.0, activation: 1.0, activation_slope: 0.0 };
        match *self {
            Self::Softplus { width } if x < SOFTPLUS_CUTOFF * width => {
                let t = x / width;
                // ln(1 + exp(-t)) without overflow for large penetrations.
                let softplus = (-t).max(0.0) + (-t.abs()).exp().ln_1p();
                let activation = 1.0 / (1.0 + t.exp());
                Some(OnsetSample {
                    gap: -width * softplus,
                    slope: activation,
                    activation,
                    activation_slope: -activation * (1.0 - activation) / width,
                })
            }
            Self::Softplus { .. } => None,
            _ if x < 0.0 => Some(hard),
            Self::Leaky { alpha, band, .. } if x < band => {
                Some(OnsetSample { gap: 0.0, slope: alpha, activation: 0.0, activation_slope: 0.0 })
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::check::finite_difference_gradient;

    use super::*;

    #[test]
    fn softplus_derivatives_match_differences() {
        let onset = Onset::Softplus { width: 3e-4 };
        for x in [-1e-1, -5e-3, -1e-4, 0.0, 2e-4, 3e-3] {
            let s = onset.at(x).unwrap();
            let d = |f: fn(OnsetSample) -> f64| {
                finite_difference_gradient(|x| f(onset.at(x[0]).unwrap()), &[x], 1e-6)[0]
            };
            assert!((d(|s| s.gap) - s.slope).abs() < 1e-8 && s.slope == s.activation);
            assert!((d(|s| s.activation) - s.activation_slope).abs() < 1e-6 * 3e3);
            assert!(s.gap <= x.min(0.0));
        }
        assert!(onset.at(onset.band()).is_none());
        assert!(onset.at(onset.band() * 0.999).unwrap().gap.abs() < 1e-16);
    }

    #[test]
    fn leaky_changes_only_the_derivative() {
        let leaky = Onset::Leaky { alpha: 0.1, band: 2e-3, steps: LeakSteps::First };
        for x in [-1e-2, -1e-6] {
            assert_eq!(leaky.at(x), Onset::Hard.at(x));
        }
        let inside = leaky.at(1e-3).unwrap();
        assert_eq!((inside.gap, inside.activation, inside.slope), (0.0, 0.0, 0.1));
        assert_eq!(leaky.at(2e-3), None);
        assert_eq!((leaky.at_step(0), leaky.at_step(1)), (leaky, Onset::Hard));
    }
}
