//! How contact begins: the map from gap to effective gap, and its derivative.

use super::error::LawError;

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
    /// [`Onset::Leaky`] in reverse mode only where it pulls a contact in: an inactive contact passes on the
    /// part of a gradient whose descent would close its gap, and nothing that would open it further
    /// ([`OnsetSample::pull_back`]). Forward mode knows no loss, so there it is [`Onset::Leaky`].
    AsymmetricLeaky {
        /// Derivative where inactive, usually 0.1.
        alpha: f64,
        /// Distance \[m\] within which inactive contacts leak, as in [`Onset::Leaky`].
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
    /// Whether reverse mode passes on only what closes the gap ([`Onset::AsymmetricLeaky`]).
    pub closes_only: bool,
}

impl OnsetSample {
    /// Reverse mode: the adjoint of x, from those of the effective gap and of the activation.
    #[inline]
    pub fn pull_back(&self, gap_adjoint: f64, activation_adjoint: f64) -> f64 {
        // A loss that grows with the gap falls as the contact closes.
        let gap_adjoint = if self.closes_only { gap_adjoint.max(0.0) } else { gap_adjoint };
        self.slope * gap_adjoint + self.activation_slope * activation_adjoint
    }
}

/// exp(−30) of a softplus is below what a sum of forces can resolve.
const SOFTPLUS_CUTOFF: f64 = 30.0;

impl Onset {
    /// The leaky gradient of Grasp'D, the symmetric form: α = 0.1 on every step, at any distance and for
    /// gradients of either sign.
    ///
    /// In D. Turpin et al., "Grasp'D", ECCV 2022, the gradient of c = min(φ − ρ, 0) is α instead of 0 where
    /// inactive. The authors' code (`leaky_min` in its dFlex) multiplies the adjoint by 0.1, and gives this form
    /// no name.
    pub fn grasp_d() -> Self {
        Self::Leaky { alpha: 0.1, band: f64::INFINITY, steps: LeakSteps::All }
    }

    /// The leaky gradient of Fast-Grasp'D, the asymmetric form: as [`Onset::grasp_d`], but only what closes a
    /// gap leaks.
    ///
    /// D. Turpin et al., "Fast-Grasp'D", ICRA 2023. The rule and its name are those of the code that the authors
    /// published later: its `leaky_max` of the depth passes 0.1 times an adjoint below zero, and none above.
    /// That depth is minus the gap here.
    pub fn fast_grasp_d() -> Self {
        Self::AsymmetricLeaky { alpha: 0.1, band: f64::INFINITY, steps: LeakSteps::All }
    }

    /// Checks the parameters: a softplus needs a positive and finite `width`, a leak an `alpha` in 0..=1 and a
    /// positive `band`, which may be infinite.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn check(&self) -> Result<(), LawError> {
        match *self {
            Self::Hard => Ok(()),
            Self::Softplus { width } => LawError::check_positive("width", width),
            Self::Leaky { alpha, band, .. } | Self::AsymmetricLeaky { alpha, band, .. } => {
                LawError::check_fraction("alpha", alpha)?;
                LawError::check_distance("band", band)
            }
        }
    }

    /// Beyond this gap value and derivative are zero \[m\].
    #[inline]
    pub fn band(&self) -> f64 {
        match *self {
            Self::Hard => 0.0,
            Self::Softplus { width } => SOFTPLUS_CUTOFF * width,
            Self::Leaky { band, .. } | Self::AsymmetricLeaky { band, .. } => band,
        }
    }

    /// Whether there are contacts with a derivative that exert no force.
    #[inline]
    pub(crate) fn leaks(&self) -> bool {
        matches!(self, Self::Leaky { .. } | Self::AsymmetricLeaky { .. })
    }

    /// The onset to use at step number `index` of a rollout.
    #[inline]
    pub fn at_step(&self, index: usize) -> Self {
        match self {
            Self::Leaky { steps: LeakSteps::First, .. }
            | Self::AsymmetricLeaky { steps: LeakSteps::First, .. }
                if index > 0 =>
            {
                Self::Hard
            }
            other => *other,
        }
    }

    /// The onset at gap `x` \[m\], or `None` where value and derivative are zero.
    #[inline]
    pub fn at(&self, x: f64) -> Option<OnsetSample> {
        let hard = OnsetSample {
            gap: x,
            slope: 1.0,
            activation: 1.0,
            activation_slope: 0.0,
            closes_only: false,
        };
        let leak = |slope, closes_only| {
            Some(OnsetSample {
                gap: 0.0,
                slope,
                activation: 0.0,
                activation_slope: 0.0,
                closes_only,
            })
        };
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
                    closes_only: false,
                })
            }
            Self::Softplus { .. } => None,
            _ if x < 0.0 => Some(hard),
            Self::Leaky { alpha, band, .. } if x < band => leak(alpha, false),
            Self::AsymmetricLeaky { alpha, band, .. } if x < band => leak(alpha, true),
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
    #[test]
    fn presets_are_the_adjoints_of_their_authors() {
        // dFlex's leaky_min(a, 0, r): 1 where a < 0, else r.
        let leaky_min = |a: f64, adjoint: f64| if a < 0.0 { adjoint } else { 0.1 * adjoint };
        // Fast-Grasp'D's leaky_max(a, 0, r) of the depth a: 1 where a > 0, else r for adjoints below zero.
        let leaky_max = |a: f64, adjoint: f64| match a > 0.0 {
            true => adjoint,
            false if adjoint < 0.0 => 0.1 * adjoint,
            false => 0.0,
        };
        for x in [-1.0, -1e-9, 0.0, 1e-9, 1e-3, 1.0, 1e6] {
            for adjoint in [-2.0, 0.0, 3.0] {
                let symmetric = Onset::grasp_d().at(x).unwrap();
                assert_eq!(symmetric.gap, x.min(0.0));
                assert_eq!(symmetric.pull_back(adjoint, 0.0), leaky_min(x, adjoint));
                let asymmetric = Onset::fast_grasp_d().at(x).unwrap();
                assert_eq!(asymmetric.gap, -f64::max(-x, 0.0));
                // Depth and gap differ in sign, and so do their adjoints.
                assert_eq!(asymmetric.pull_back(adjoint, 0.0), -leaky_max(-x, -adjoint));
                assert_eq!(asymmetric.slope, symmetric.slope);
            }
        }
    }

    #[test]
    fn reverse_mode_of_a_softplus_is_its_derivative() {
        let sample = Onset::Softplus { width: 3e-4 }.at(1e-4).unwrap();
        let expected = 2.0 * sample.slope - 3e-4 * sample.activation_slope;
        assert_eq!(sample.pull_back(2.0, -3e-4), expected);
    }

    #[test]
    fn bad_parameters_are_named() {
        let steps = LeakSteps::All;
        for bad in [-1.0, 0.0, f64::NAN, f64::INFINITY] {
            assert_eq!(Onset::Softplus { width: bad }.check().unwrap_err().name, "width");
        }
        for bad in [-0.1, 1.1, f64::NAN] {
            for onset in [
                Onset::Leaky { alpha: bad, band: 1e-3, steps },
                Onset::AsymmetricLeaky { alpha: bad, band: 1e-3, steps },
            ] {
                assert_eq!(onset.check().unwrap_err().name, "alpha");
            }
        }
        for bad in [-1e-3, 0.0, f64::NAN] {
            let error = Onset::Leaky { alpha: 0.1, band: bad, steps }.check().unwrap_err();
            assert_eq!(error.name, "band");
        }
        for good in [Onset::Hard, Onset::Softplus { width: 1e-4 }, Onset::grasp_d()] {
            assert_eq!(good.check(), Ok(()));
        }
        assert_eq!(Onset::fast_grasp_d().check(), Ok(()));
    }
}
