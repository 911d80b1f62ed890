//! The law of Hunt and Crossley, per area, with Coulomb friction.

use prehend_autodiff::Scalar;

use super::error::LawError;
use super::law::{Contact, Isotropic, IsotropicLaw};
use super::resting::RestingContact;
use super::restitution::hunt_crossley_damping;

/// A power-law spring whose damping grows with the load: f_n = A·K·dⁿ·max(0, 1 + c ḋ) for depth d = −g, with
/// friction coefficient μ (K. H. Hunt and F. R. E. Crossley, "Coefficient of restitution interpreted as
/// damping in vibroimpact", J. Applied Mechanics 42, 1975).
///
/// Unlike with a linear damper the force starts from zero at any speed, so contact begins without a jump; for
/// n > 1 it begins without a kink too, and a leaky onset has nothing to leak. It bounces with
/// [`hunt_crossley_restitution`](super::restitution::hunt_crossley_restitution), whatever K and n. A free
/// rebound never reaches the clamp; bodies that are pulled apart do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HuntCrossley {
    /// Stiffness K \[N/m^{2+n}\], damping c \[s/m\], exponent n, friction coefficient μ.
    params: [f64; 4],
    slip_scale: f64,
}

/// [`HuntCrossley`] as a contact law.
pub type HuntCrossleyPenalty = Isotropic<HuntCrossley>;

impl HuntCrossleyPenalty {
    /// `stiffness` per area \[N/m^{2+n}\] > 0, `damping` c \[s/m\] ≥ 0, `exponent` n ≥ 1 (real), `friction`
    /// coefficient ≥ 0, and the slip speed `slip_scale` \[m/s\] > 0 that regularizes friction.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(
        stiffness: f64,
        damping: f64,
        exponent: f64,
        friction: f64,
        slip_scale: f64,
    ) -> Result<Self, LawError> {
        LawError::check_positive("stiffness", stiffness)?;
        LawError::check_not_negative("damping", damping)?;
        LawError::check_at_least_one("exponent", exponent)?;
        LawError::check_not_negative("friction", friction)?;
        LawError::check_positive("slip_scale", slip_scale)?;
        Ok(Isotropic(HuntCrossley { params: [stiffness, damping, exponent, friction], slip_scale }))
    }

    /// The law on which `resting` rests, and which bounces with coefficient `restitution` (above 0, at most
    /// 1) when hit at `impact_speed` \[m/s\] > 0. Slower impacts bounce more.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn from_resting(
        resting: &RestingContact,
        exponent: f64,
        restitution: f64,
        impact_speed: f64,
        friction: f64,
        slip_scale: f64,
    ) -> Result<Self, LawError> {
        resting.check()?;
        LawError::check_restitution(restitution)?;
        LawError::check_positive("impact_speed", impact_speed)?;
        let damping = hunt_crossley_damping(restitution, impact_speed);
        Self::new(resting.stiffness(exponent), damping, exponent, friction, slip_scale)
    }
}

impl IsotropicLaw for HuntCrossley {
    #[inline]
    fn params(&self) -> &[f64] {
        &self.params
    }

    #[inline]
    fn normal_force<S: Scalar>(&self, p: &[S], contact: &Contact<S>) -> S {
        let &[stiffness, damping, exponent, ..] = p else { return S::zero() };
        let depth = -contact.gap;
        let load = S::one() - damping * contact.normal_speed;
        if depth.value() < 0.0 || load.value() <= 0.0 {
            return S::zero();
        }
        stiffness * depth.powf(exponent) * load * S::constant(contact.area)
    }

    #[inline]
    fn friction_coefficient<S: Scalar>(&self, p: &[S], _slip_speed: S) -> S {
        p.get(3).copied().unwrap_or_else(S::zero)
    }

    #[inline]
    fn slip_scale(&self) -> f64 {
        self.slip_scale
    }

    fn check(&self, p: &[f64]) -> Result<(), LawError> {
        HuntCrossleyPenalty::new(p[0], p[1], p[2], p[3], self.slip_scale).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::HertzPenalty;
    use crate::contact::law_checks::{Claims, bounce, check_law, load};

    #[test]
    fn keeps_what_laws_promise() {
        for exponent in [1.0, 1.5, 2.2] {
            let law = HuntCrossleyPenalty::new(4e8, 0.8, exponent, 0.6, 1e-2).unwrap();
            check_law(&law, &Claims::new(0.6));
        }
        let error = HuntCrossleyPenalty::new(4e8, 0.8, 0.9, 0.6, 1e-2).unwrap_err();
        assert_eq!(error.to_string(), "exponent must be at least 1, is 0.9");
    }

    #[test]
    fn undamped_with_three_halves_is_hertz() {
        let law = HuntCrossleyPenalty::new(4e8, 0.0, 1.5, 0.0, 1e-2).unwrap();
        let hertz = HertzPenalty::new(4e8, 0.0, 1e-2).unwrap();
        assert!((load(&law, 1e-4, 3e-4) / load(&hertz, 1e-4, 3e-4) - 1.0).abs() < 1e-14);
    }

    #[test]
    fn rests_and_bounces_as_told_whatever_the_exponent() {
        let resting =
            RestingContact { mass: 0.3, gravity: 9.81, penetration: 5e-4, contact_area: 4e-4 };
        for (exponent, e) in [(1.0, 0.8), (1.5, 0.5), (2.5, 0.2)] {
            let law = HuntCrossleyPenalty::from_resting(&resting, exponent, e, 0.5, 0.5, 1e-3);
            let law = law.unwrap();
            assert!((load(&law, 4e-4, 5e-4) - 0.3 * 9.81).abs() < 1e-12);
            let measured = bounce(&law, &resting, 0.5);
            assert!((measured - e).abs() < 3e-4, "{exponent}: {measured} for {e}");
        }
    }
}
