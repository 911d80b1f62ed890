//! The linear Kelvin–Voigt normal law, per area.

use prehend_autodiff::Scalar;

use super::NormalLaw;
use crate::contact::calibration::ContactCalibration;
use crate::contact::error::LawError;
use crate::contact::parameters::{Parameters, law_part};
use crate::contact::point::ContactKinematics;
use crate::contact::restitution::damping_ratio;

law_part! {
    /// Spring and damper per area, clamped so that contact never pulls: f_n = A·max(0, −K g − D ġ) for g ≤ 0.
    ///
    /// Per area, so that forces of a face do not depend on how many samples it carries. Contact ends while the body is
    /// still inside, which is where the clamped formula of [`restitution`](crate::contact::restitution::restitution)
    /// comes from; [`ApproachDamped`](super::approach_damped::ApproachDamped) bounces more for the same damping.
    pub struct KelvinVoigt: "linear spring and damper that never pull" {
        stiffness ["N/m^3"] Positive "pressure per depth";
        damping ["N s/m^3"] NotNegative "pressure per approach speed";
    }
}

impl KelvinVoigt {
    /// The law with which the body of `target` rests at its depth, and bounces with coefficient `restitution`, above 0 and at
    /// most 1: that of an impact without gravity, see [`ContactCalibration`].
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn from_target(target: &ContactCalibration, restitution: f64) -> Result<Self, LawError> {
        let [stiffness, damping] = target.bouncing(restitution, damping_ratio)?;
        let law = Self { stiffness, damping };
        law.check(&law.values()).map(|()| law)
    }
}

impl NormalLaw for KelvinVoigt {
    #[inline]
    fn force<S: Scalar>(&self, [stiffness, damping]: [S; 2], contact: &ContactKinematics<S>) -> S {
        let pressure = -(stiffness * contact.gap + damping * contact.normal_speed);
        // Zero counts as active: leaky smoothing differentiates a contact of exactly zero force.
        if pressure.value() < 0.0 || contact.gap.value() > 0.0 {
            return S::zero();
        }
        pressure * contact.area
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::ContactLaw;
    use crate::contact::law_checks::{Claims, TARGET, bounce, check_law, frictionless};
    use crate::scenes::penalty;

    #[test]
    fn keeps_what_laws_promise() {
        check_law(&penalty(3e7, 2e5, 0.7, 1e-2), &Claims::new(0.7));
    }

    #[test]
    fn bounces_with_its_restitution() {
        // The last two are overdamped.
        for e in [0.9, 0.451, 0.1, 0.03] {
            let law = frictionless(KelvinVoigt::from_target(&TARGET, e));
            assert!((bounce(&law, &TARGET, 0.5) - e).abs() < 2e-4);
        }
        let error = KelvinVoigt::from_target(&TARGET, 1.1).unwrap_err();
        assert_eq!(error.name(), Some("restitution"));
    }

    #[test]
    fn contact_never_pulls() {
        let law = penalty(1e6, 1e5, 0.5, 1e-3);
        let slip = Vector3::new(0.1, 0.0, 0.0);
        let leaving = ContactKinematics {
            gap: -1e-3,
            normal_speed: 1.0,
            slip,
            normal: Vector3::z(),
            area: 1e-4,
        };
        let response = law.law(law.params(), &leaving);
        assert_eq!((response.normal, response.tangential.norm()), (0.0, 0.0));
        let resting = ContactKinematics { normal_speed: 0.0, ..leaving };
        assert!((law.law(law.params(), &resting).normal - 0.1).abs() < 1e-15);
    }
}
