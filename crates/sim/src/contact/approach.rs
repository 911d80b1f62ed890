//! The linear Kelvin–Voigt law whose damper acts on approach only.

use prehend_autodiff::Scalar;

use super::error::LawError;
use super::law::{Contact, Isotropic, IsotropicLaw};
use super::penalty::{KelvinVoigt, Penalty};
use super::resting::RestingContact;
use super::restitution::approach_damping_ratio;

/// Spring, and a damper that resists approach only: f_n = A·(−K g + D·max(0, −ġ)) for g ≤ 0, as in NVIDIA
/// Warp's simulator, with friction coefficient μ.
///
/// Contact lasts until the gap closes, without clamping: a body leaves as fast as the spring throws it. It
/// bounces with [`approach_restitution`](super::restitution::approach_restitution).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ApproachDamped(KelvinVoigt);

/// [`ApproachDamped`] as a contact law.
pub type ApproachPenalty = Isotropic<ApproachDamped>;

impl ApproachPenalty {
    /// `stiffness` per area \[N/m³\] > 0, `damping` per area \[N s/m³\] ≥ 0, `friction` coefficient ≥ 0,
    /// and the slip speed `slip_scale` \[m/s\] > 0 that regularizes friction.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(
        stiffness: f64,
        damping: f64,
        friction: f64,
        slip_scale: f64,
    ) -> Result<Self, LawError> {
        let Isotropic(law) = Penalty::new(stiffness, damping, friction, slip_scale)?;
        Ok(Isotropic(ApproachDamped(law)))
    }

    /// The law on which `resting` rests, and which bounces with coefficient `restitution` (above 0, at most 1).
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn from_resting(
        resting: &RestingContact,
        restitution: f64,
        friction: f64,
        slip_scale: f64,
    ) -> Result<Self, LawError> {
        let [stiffness, damping] = resting.bouncing(restitution, approach_damping_ratio)?;
        Self::new(stiffness, damping, friction, slip_scale)
    }
}

impl IsotropicLaw for ApproachDamped {
    #[inline]
    fn params(&self) -> &[f64] {
        self.0.params()
    }

    #[inline]
    fn normal_force<S: Scalar>(&self, p: &[S], contact: &Contact<S>) -> S {
        let &[stiffness, damping, ..] = p else { return S::zero() };
        if contact.gap.value() > 0.0 {
            return S::zero();
        }
        // A still contact counts as approaching: its derivative then resists both ways.
        let approaching = contact.normal_speed.value() <= 0.0;
        let damper = if approaching { damping * contact.normal_speed } else { S::zero() };
        -(stiffness * contact.gap + damper) * S::constant(contact.area)
    }

    #[inline]
    fn friction_coefficient<S: Scalar>(&self, p: &[S], slip_speed: S) -> S {
        self.0.friction_coefficient(p, slip_speed)
    }

    #[inline]
    fn slip_scale(&self) -> f64 {
        self.0.slip_scale()
    }

    fn check(&self, p: &[f64]) -> Result<(), LawError> {
        self.0.check(p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::law_checks::{Claims, bounce, check_law};
    use crate::contact::restitution::approach_restitution;

    #[test]
    fn keeps_what_laws_promise() {
        let claims = Claims { smooth_at_rest: false, ..Claims::new(0.4) };
        check_law(&ApproachPenalty::new(3e7, 2e5, 0.4, 1e-2).unwrap(), &claims);
    }

    #[test]
    fn bounces_with_its_restitution() {
        let resting =
            RestingContact { mass: 0.3, gravity: 9.81, penetration: 5e-4, contact_area: 4e-4 };
        // The last two are overdamped.
        for e in [0.9, 0.6715, 0.3, 0.1] {
            let law = ApproachPenalty::from_resting(&resting, e, 0.0, 1e-3).unwrap();
            assert!((bounce(&law, &resting, 0.5) - e).abs() < 2e-4);
        }
        assert!((approach_restitution(0.3) - 0.6715).abs() < 5e-5);
        let error = ApproachPenalty::from_resting(&resting, 0.0, 0.0, 1e-3).unwrap_err();
        assert_eq!(error.name, "restitution");
    }
}
