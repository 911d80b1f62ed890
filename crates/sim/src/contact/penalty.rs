//! The linear Kelvin–Voigt penalty law, per area, with Coulomb friction.

use prehend_autodiff::Scalar;

use super::error::LawError;
use super::law::{Contact, Isotropic, IsotropicLaw};
use super::resting::RestingContact;
use super::restitution::damping_ratio;

/// Spring and damper per area, clamped so that contact never pulls:
/// f_n = A·max(0, −K g − D ġ) for g ≤ 0, with friction coefficient μ.
///
/// Per area, so that forces do not depend on how many samples a surface carries. Contact ends while the body is
/// still inside, which is where the clamped formula of [`restitution`](super::restitution::restitution) comes
/// from; [`ApproachDamped`](super::approach::ApproachDamped) bounces more for the same damping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KelvinVoigt {
    /// Stiffness K \[N/m³\], damping D \[N s/m³\], friction coefficient μ.
    params: [f64; 3],
    slip_scale: f64,
}

/// [`KelvinVoigt`] as a contact law.
pub type Penalty = Isotropic<KelvinVoigt>;

impl Penalty {
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
        LawError::check_positive("stiffness", stiffness)?;
        LawError::check_not_negative("damping", damping)?;
        LawError::check_not_negative("friction", friction)?;
        LawError::check_positive("slip_scale", slip_scale)?;
        Ok(Isotropic(KelvinVoigt { params: [stiffness, damping, friction], slip_scale }))
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
        let [stiffness, damping] = resting.bouncing(restitution, damping_ratio)?;
        Self::new(stiffness, damping, friction, slip_scale)
    }
}

impl IsotropicLaw for KelvinVoigt {
    #[inline]
    fn params(&self) -> &[f64] {
        &self.params
    }

    #[inline]
    fn normal_force<S: Scalar>(&self, p: &[S], contact: &Contact<S>) -> S {
        let &[stiffness, damping, ..] = p else { return S::zero() };
        let pressure = -(stiffness * contact.gap + damping * contact.normal_speed);
        // Zero counts as active: a leaky onset differentiates a contact of exactly zero force.
        if pressure.value() < 0.0 || contact.gap.value() > 0.0 {
            return S::zero();
        }
        pressure * S::constant(contact.area)
    }

    #[inline]
    fn friction_coefficient<S: Scalar>(&self, p: &[S], _slip_speed: S) -> S {
        p.get(2).copied().unwrap_or_else(S::zero)
    }

    #[inline]
    fn slip_scale(&self) -> f64 {
        self.slip_scale
    }

    fn check(&self, p: &[f64]) -> Result<(), LawError> {
        Penalty::new(p[0], p[1], p[2], self.slip_scale).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::ContactLaw;
    use crate::contact::law_checks::{Claims, bounce, check_law};

    #[test]
    fn keeps_what_laws_promise() {
        check_law(&Penalty::new(3e7, 2e5, 0.7, 1e-2).unwrap(), &Claims::new(0.7));
    }

    #[test]
    fn bounces_with_its_restitution() {
        let resting =
            RestingContact { mass: 0.3, gravity: 9.81, penetration: 5e-4, contact_area: 4e-4 };
        // The last two are overdamped.
        for e in [0.9, 0.451, 0.1, 0.03] {
            let law = Penalty::from_resting(&resting, e, 0.0, 1e-3).unwrap();
            assert!((bounce(&law, &resting, 0.5) - e).abs() < 2e-4);
        }
        let error = Penalty::from_resting(&resting, 1.1, 0.0, 1e-3).unwrap_err();
        assert_eq!(error.name, "restitution");
    }

    #[test]
    fn bad_parameters_are_named() {
        let error = Penalty::new(-1.0, 0.0, 0.5, 1e-3).unwrap_err();
        assert_eq!(error.to_string(), "stiffness must be positive, is -1");
        assert_eq!(Penalty::new(1.0, 0.0, 0.5, 0.0).unwrap_err().name, "slip_scale");
        assert_eq!(Penalty::new(1.0, f64::NAN, 0.5, 1.0).unwrap_err().name, "damping");
    }

    #[test]
    fn contact_never_pulls() {
        let law = Penalty::new(1e6, 1e5, 0.5, 1e-3).unwrap();
        let slip = Vector3::new(0.1, 0.0, 0.0);
        let leaving =
            Contact { gap: -1e-3, normal_speed: 1.0, slip, normal: Vector3::z(), area: 1e-4 };
        let response = law.law(law.params(), &leaving);
        assert_eq!((response.normal, response.tangential.norm()), (0.0, 0.0));
        let resting = Contact { normal_speed: 0.0, ..leaving };
        assert!((law.law(law.params(), &resting).normal - 0.1).abs() < 1e-15);
    }
}
