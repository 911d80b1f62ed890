//! Stick–slip friction for any isotropic law.

use prehend_autodiff::Scalar;

use super::error::LawError;
use super::law::{Contact, Isotropic, IsotropicLaw};

/// `law` with friction that falls from its own coefficient μ_s at rest to μ_k in fast slip:
/// μ(u) = μ_k + (μ_s − μ_k)·exp(−(u/u_st)²) (the Stribeck curve in the Gaussian form of B. Armstrong-Hélouvry,
/// P. Dupont and C. Canudas de Wit, Automatica 30(7), 1994).
///
/// Friction never exceeds μ_s f_n. It is regularized like all friction here, so the static peak shows only for
/// u_st several times the slip scale v_s.
///
/// ```
/// use prehend_sim::{ContactLaw, Penalty};
///
/// let law = Penalty::new(2e7, 1e4, 0.6, 1e-4)?.with_stribeck(0.4, 1e-2)?;
/// assert_eq!(law.params(), [2e7, 1e4, 0.6, 0.4, 1e-2]);
/// # Ok::<(), prehend_sim::LawError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Stribeck<L> {
    law: L,
    /// The parameters of `law`, then μ_k and u_st \[m/s\].
    params: Vec<f64>,
}

impl<L: IsotropicLaw> Isotropic<L> {
    /// This law with stick–slip friction: its own coefficient at rest, `kinetic_friction` in fast slip (at
    /// least 0, at most the law's own), `stribeck_speed` \[m/s\] > 0 between. See [`Stribeck`].
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn with_stribeck(
        self,
        kinetic_friction: f64,
        stribeck_speed: f64,
    ) -> Result<Isotropic<Stribeck<L>>, LawError> {
        let Isotropic(law) = self;
        LawError::check_not_negative("kinetic_friction", kinetic_friction)?;
        LawError::check_positive("stribeck_speed", stribeck_speed)?;
        if kinetic_friction > law.friction_coefficient(law.params(), law.slip_scale()) {
            let range = "at most the friction at rest";
            return Err(LawError { name: "kinetic_friction", range, value: kinetic_friction });
        }
        let params = [law.params(), &[kinetic_friction, stribeck_speed]].concat();
        Ok(Isotropic(Stribeck { law, params }))
    }
}

impl<L: IsotropicLaw> IsotropicLaw for Stribeck<L> {
    #[inline]
    fn params(&self) -> &[f64] {
        &self.params
    }

    #[inline]
    fn normal_force<S: Scalar>(&self, p: &[S], contact: &Contact<S>) -> S {
        let [inner @ .., _, _] = p else { return S::zero() };
        self.law.normal_force(inner, contact)
    }

    #[inline]
    fn friction_coefficient<S: Scalar>(&self, p: &[S], slip_speed: S) -> S {
        let &[ref inner @ .., kinetic, stribeck_speed] = p else { return S::zero() };
        // The slip speed proper: the law is handed √(u² + v_s²).
        let slip2 = slip_speed * slip_speed - S::constant(self.slip_scale().powi(2));
        let stick = (-slip2 / (stribeck_speed * stribeck_speed)).exp();
        kinetic + (self.law.friction_coefficient(inner, slip_speed) - kinetic) * stick
    }

    #[inline]
    fn slip_scale(&self) -> f64 {
        self.law.slip_scale()
    }

    #[inline]
    fn reach(&self) -> f64 {
        self.law.reach()
    }

    fn check(&self, p: &[f64]) -> Result<(), LawError> {
        self.law.check(&p[..self.law.params().len()])
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::contact::law_checks::{Claims, check_law};
    use crate::{ApproachPenalty, ContactLaw, HertzPenalty, HuntCrossleyPenalty, Penalty};

    #[test]
    fn every_law_keeps_its_promises_with_stick_slip() {
        let claims = Claims::new(0.6);
        let kinked = Claims { smooth_at_rest: false, ..claims };
        let scale = 1e-2;
        let (k, u) = (0.35, 0.05);
        check_law(
            &Penalty::new(3e7, 2e5, 0.6, scale).unwrap().with_stribeck(k, u).unwrap(),
            &claims,
        );
        let approach = ApproachPenalty::new(3e7, 2e5, 0.6, scale).unwrap();
        check_law(&approach.with_stribeck(k, u).unwrap(), &kinked);
        check_law(
            &HertzPenalty::new(4e8, 0.6, scale).unwrap().with_stribeck(k, u).unwrap(),
            &claims,
        );
        let hunt = HuntCrossleyPenalty::new(4e8, 0.8, 1.5, 0.6, scale).unwrap();
        check_law(&hunt.with_stribeck(k, u).unwrap(), &claims);
    }

    #[test]
    fn friction_falls_from_static_to_kinetic() {
        let law = Penalty::new(1e7, 0.0, 0.6, 1e-6).unwrap().with_stribeck(0.4, 1e-2).unwrap();
        let ratio = |speed: f64| {
            let slip = Vector3::new(speed, 0.0, 0.0);
            let contact =
                Contact { gap: -1e-3, normal_speed: 0.0, slip, normal: Vector3::z(), area: 1e-4 };
            let response = law.law(law.params(), &contact);
            response.tangential.norm() / response.normal
        };
        assert!((ratio(1e-4) - 0.6).abs() < 1e-4);
        assert!((ratio(1e-2) - (0.4 + 0.2 * (-1f64).exp())).abs() < 1e-8);
        assert!((ratio(1.0) - 0.4).abs() < 1e-8);
    }

    #[test]
    fn bad_parameters_are_named() {
        let law = Penalty::new(1e7, 0.0, 0.6, 1e-3).unwrap();
        for (kinetic, speed, name) in [
            (-0.1, 1e-2, "kinetic_friction"),
            (0.7, 1e-2, "kinetic_friction"),
            (f64::NAN, 1e-2, "kinetic_friction"),
            (0.4, 0.0, "stribeck_speed"),
        ] {
            assert_eq!(law.with_stribeck(kinetic, speed).unwrap_err().name, name);
        }
    }
}
