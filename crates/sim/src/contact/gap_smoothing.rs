//! Smoothing of the gap where contact begins: the map from gap to effective gap, and its derivative.

use super::error::LawError;
use super::range::ParameterRange;

/// The map x ↦ effective gap that precedes a contact law, for the gap x beyond the law's cutoff.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GapSmoothing {
    /// min(x, 0).
    Hard,
    /// −ε ln(1 + exp(−x/ε)): smooth, and a real function, so its derivatives are those of the forces.
    Softplus {
        /// ε \[m\], positive: a tenth of the depth to which a body sinks in at rest, often 0.05 mm. Contact is felt some
        /// five times as far away. With fixed steps at least 0.65 |v_n| dt keeps gradients through impacts right.
        width: f64,
    },
    /// [`GapSmoothing::Hard`] in value; its derivative where inactive is `alpha` instead of zero, so that
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

/// A smoothed gap with its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothedGap {
    /// Effective gap \[m\], at most zero.
    pub gap: f64,
    /// Slope d gap / dx that gradients use: the true derivative, except where leaky.
    pub slope: f64,
    /// True derivative d gap / dx, by which gap rates are scaled, in 0..=1.
    pub activation: f64,
    /// d activation / dx \[1/m\].
    pub activation_slope: f64,
}

/// exp(−30) of a softplus is below what a sum of forces can resolve.
const SOFTPLUS_CUTOFF: f64 = 30.0;

impl GapSmoothing {
    /// The leaky gradient of Grasp'D, the symmetric form: α = 0.1 on every step, at any distance and for
    /// gradients of either sign.
    ///
    /// In D. Turpin et al., "Grasp'D", ECCV 2022, the gradient of c = min(φ − ρ, 0) is α instead of 0 where
    /// inactive. The authors' code (`leaky_min` in its dFlex) multiplies the adjoint by 0.1, and gives this form
    /// no name.
    pub fn grasp_d() -> Self {
        Self::Leaky { alpha: 0.1, band: f64::INFINITY, steps: LeakSteps::All }
    }

    /// Checks the parameters: a softplus needs a positive and finite `width`, a leak an `alpha` in 0..=1 and a
    /// positive `band`, which may be infinite.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn check(&self) -> Result<(), LawError> {
        match *self {
            Self::Hard => Ok(()),
            Self::Softplus { width } => ParameterRange::Positive.check("width", width),
            Self::Leaky { alpha, band, .. } => {
                ParameterRange::Fraction.check("alpha", alpha)?;
                ParameterRange::PositiveOrInfinite.check("band", band)
            }
        }
    }

    /// Beyond this gap value and derivative are zero \[m\].
    #[inline]
    pub fn band(&self) -> f64 {
        match *self {
            Self::Hard => 0.0,
            Self::Softplus { width } => SOFTPLUS_CUTOFF * width,
            Self::Leaky { band, .. } => band,
        }
    }

    /// Beyond this gap there is no force \[m\]: leaks have none.
    #[inline]
    pub(crate) fn force_band(&self) -> f64 {
        if self.leaks() { 0.0 } else { self.band() }
    }

    /// True if there are contacts with a derivative that exert no force.
    #[inline]
    pub(crate) fn leaks(&self) -> bool {
        matches!(self, Self::Leaky { .. })
    }

    /// The smoothing to use at step number `index` of a rollout.
    #[inline]
    pub fn at_step(&self, index: usize) -> Self {
        match self {
            Self::Leaky { steps: LeakSteps::First, .. } if index > 0 => Self::Hard,
            other => *other,
        }
    }

    /// The smoothing at gap `x` \[m\], or `None` where value and derivative are zero.
    #[inline]
    pub fn at(&self, x: f64) -> Option<SmoothedGap> {
        match *self {
            Self::Softplus { width } if x < SOFTPLUS_CUTOFF * width => {
                let t = x / width;
                // ln(1 + exp(-t)) without overflow for large penetrations.
                let softplus = (-t).max(0.0) + (-t.abs()).exp().ln_1p();
                let activation = 1.0 / (1.0 + t.exp());
                Some(SmoothedGap {
                    gap: -width * softplus,
                    slope: activation,
                    activation,
                    activation_slope: -activation * (1.0 - activation) / width,
                })
            }
            Self::Softplus { .. } => None,
            _ if x < 0.0 => {
                Some(SmoothedGap { gap: x, slope: 1.0, activation: 1.0, activation_slope: 0.0 })
            }
            Self::Leaky { alpha, band, .. } if x < band => {
                Some(SmoothedGap { gap: 0.0, slope: alpha, activation: 0.0, activation_slope: 0.0 })
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
        let smoothing = GapSmoothing::Softplus { width: 3e-4 };
        for x in [-1e-1, -5e-3, -1e-4, 0.0, 2e-4, 3e-3] {
            let s = smoothing.at(x).unwrap();
            let d = |f: fn(SmoothedGap) -> f64| {
                finite_difference_gradient(|x| f(smoothing.at(x[0]).unwrap()), &[x], 1e-6)[0]
            };
            assert!((d(|s| s.gap) - s.slope).abs() < 1e-8 && s.slope == s.activation);
            assert!((d(|s| s.activation) - s.activation_slope).abs() < 1e-6 * 3e3);
            assert!(s.gap <= x.min(0.0));
        }
        assert!(smoothing.at(smoothing.band()).is_none());
        assert!(smoothing.at(smoothing.band() * 0.999).unwrap().gap.abs() < 1e-16);
    }

    #[test]
    fn leaky_changes_only_the_derivative() {
        let leaky = GapSmoothing::Leaky { alpha: 0.1, band: 2e-3, steps: LeakSteps::First };
        for x in [-1e-2, -1e-6] {
            assert_eq!(leaky.at(x), GapSmoothing::Hard.at(x));
        }
        let inside = leaky.at(1e-3).unwrap();
        assert_eq!((inside.gap, inside.activation, inside.slope), (0.0, 0.0, 0.1));
        assert_eq!(leaky.at(2e-3), None);
        assert_eq!((leaky.at_step(0), leaky.at_step(1)), (leaky, GapSmoothing::Hard));
    }

    #[test]
    fn the_preset_is_the_gradient_of_its_authors() {
        // dFlex's leaky_min(a, 0, r): 1 where a < 0, else r.
        let leaky_min = |a: f64| if a < 0.0 { 1.0 } else { 0.1 };
        for x in [-1.0, -1e-9, 0.0, 1e-9, 1e-3, 1.0, 1e6] {
            let sample = GapSmoothing::grasp_d().at(x).unwrap();
            assert_eq!((sample.gap, sample.slope), (x.min(0.0), leaky_min(x)));
        }
    }

    #[test]
    fn bad_parameters_are_named() {
        let steps = LeakSteps::All;
        for bad in [-1.0, 0.0, f64::NAN, f64::INFINITY] {
            assert_eq!(
                GapSmoothing::Softplus { width: bad }.check().unwrap_err().name(),
                Some("width")
            );
        }
        for bad in [-0.1, 1.1, f64::NAN] {
            let error = GapSmoothing::Leaky { alpha: bad, band: 1e-3, steps }.check().unwrap_err();
            assert_eq!(error.name(), Some("alpha"));
        }
        for bad in [-1e-3, 0.0, f64::NAN] {
            let error = GapSmoothing::Leaky { alpha: 0.1, band: bad, steps }.check().unwrap_err();
            assert_eq!(error.name(), Some("band"));
        }
        for good in
            [GapSmoothing::Hard, GapSmoothing::Softplus { width: 1e-4 }, GapSmoothing::grasp_d()]
        {
            assert_eq!(good.check(), Ok(()));
        }
    }
}
