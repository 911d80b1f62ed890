//! Hertz's elastic law, per area, with Coulomb friction.

use prehend_autodiff::Scalar;

use super::error::LawError;
use super::law::{Contact, Isotropic, IsotropicLaw};
use super::resting::RestingContact;

/// An elastic contact that stiffens with depth d = −g: f_n = A·K·d^{3/2}, with friction coefficient μ.
///
/// The exponent is that of two touching spheres (H. Hertz, 1882; K. L. Johnson, Contact Mechanics, §4.2),
/// whose whole contact has F = 4/3 E* √R d^{3/2}: one sample with A·K = 4/3 E* √R reproduces it. Spread over
/// the samples of a finely sampled surface it is an elastic foundation of the same exponent.
///
/// Force and stiffness are both zero at d = 0 and continuous there, so a contact begins without a kink, and a
/// leaky onset has nothing to leak. It does not dissipate: [`HuntCrossley`](super::hunt_crossley::HuntCrossley)
/// adds damping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hertz {
    /// Stiffness K \[N/m^{7/2}\], friction coefficient μ.
    params: [f64; 2],
    slip_scale: f64,
}

/// [`Hertz`] as a contact law.
pub type HertzPenalty = Isotropic<Hertz>;

impl HertzPenalty {
    /// `stiffness` per area \[N/m^{7/2}\] > 0, `friction` coefficient ≥ 0, and the slip speed `slip_scale`
    /// \[m/s\] > 0 that regularizes friction.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(stiffness: f64, friction: f64, slip_scale: f64) -> Result<Self, LawError> {
        LawError::check_positive("stiffness", stiffness)?;
        LawError::check_not_negative("friction", friction)?;
        LawError::check_positive("slip_scale", slip_scale)?;
        Ok(Isotropic(Hertz { params: [stiffness, friction], slip_scale }))
    }

    /// The law on which `resting` rests.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn from_resting(
        resting: &RestingContact,
        friction: f64,
        slip_scale: f64,
    ) -> Result<Self, LawError> {
        resting.check()?;
        Self::new(resting.stiffness(1.5), friction, slip_scale)
    }
}

impl IsotropicLaw for Hertz {
    #[inline]
    fn params(&self) -> &[f64] {
        &self.params
    }

    #[inline]
    fn normal_force<S: Scalar>(&self, p: &[S], contact: &Contact<S>) -> S {
        let &[stiffness, ..] = p else { return S::zero() };
        let depth = -contact.gap;
        // The root's slope is infinite at zero, that of d^{3/2} is zero there.
        if depth.value() <= 0.0 {
            return S::zero();
        }
        stiffness * depth * depth.sqrt() * S::constant(contact.area)
    }

    #[inline]
    fn friction_coefficient<S: Scalar>(&self, p: &[S], _slip_speed: S) -> S {
        p.get(1).copied().unwrap_or_else(S::zero)
    }

    #[inline]
    fn slip_scale(&self) -> f64 {
        self.slip_scale
    }

    fn check(&self, p: &[f64]) -> Result<(), LawError> {
        HertzPenalty::new(p[0], p[1], self.slip_scale).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::law_checks::{Claims, bounce, check_law, load};

    #[test]
    fn keeps_what_laws_promise() {
        check_law(&HertzPenalty::new(4e8, 0.3, 1e-2).unwrap(), &Claims::new(0.3));
        assert_eq!(HertzPenalty::new(0.0, 0.3, 1e-2).unwrap_err().name, "stiffness");
    }

    #[test]
    fn carries_the_weight_at_the_target_depth_and_bounces_fully() {
        let resting =
            RestingContact { mass: 0.3, gravity: 9.81, penetration: 5e-4, contact_area: 4e-4 };
        let law = HertzPenalty::from_resting(&resting, 0.5, 1e-3).unwrap();
        assert!((load(&law, 4e-4, 5e-4) - 0.3 * 9.81).abs() < 1e-12);
        assert!((bounce(&law, &resting, 0.5) - 1.0).abs() < 2e-4);
    }

    #[test]
    fn is_the_force_of_two_spheres() {
        // Steel ball of 10 mm on steel, 1 µm deep: 4/3·115 GPa·√(10 mm)·(1 µm)^{3/2}.
        let stiffness = 4.0 / 3.0 * 115e9 * 0.01f64.sqrt();
        let law = HertzPenalty::new(stiffness, 0.0, 1e-3).unwrap();
        assert!((load(&law, 1.0, 1e-6) - 15.333_333_333).abs() < 1e-8);
    }
}
