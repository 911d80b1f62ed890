//! Stick–slip friction.

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

use super::{FrictionCoefficient, FrictionLaw};
use crate::contact::error::LawError;
use crate::contact::parameters::law_part;
use crate::contact::point::ContactKinematics;

law_part! {
    /// Friction that falls from μ_s at rest to μ_k in fast slip: μ(u) = μ_k + (μ_s − μ_k)·exp(−(u/u_st)²) (the Stribeck
    /// curve in the Gaussian form of B. Armstrong-Hélouvry, P. Dupont and C. Canudas de Wit, Automatica 30(7), 1994).
    ///
    /// Friction never exceeds μ_s f_n. It is regularized like all friction here, so the static peak shows only for
    /// u_st several times the slip scale v_s.
    pub struct Stribeck: "stick-slip friction" {
        friction [""] NotNegative "friction coefficient";
        kinetic_friction [""] NotNegative "friction coefficient in fast slip, at most that at rest";
        stribeck_speed ["m/s"] Positive "slip speed between the two";
    }
    constants {
        slip_scale ["m/s"] Positive "slip speed that regularizes it";
    }
    where kinetic_at_most_static(friction, kinetic_friction)
}

fn kinetic_at_most_static(friction: f64, kinetic: f64) -> Result<(), LawError> {
    let (name, range) = ("kinetic_friction", "at most the friction at rest");
    if kinetic <= friction { Ok(()) } else { Err(LawError::Range { name, range, value: kinetic }) }
}

impl FrictionCoefficient for Stribeck {
    #[inline]
    fn coefficient<S: Scalar>(&self, p: [S; 3], speed: S) -> S {
        let [friction, kinetic, stribeck_speed] = p;
        // The slip speed proper, from √(u² + v_s²).
        let slip2 = speed * speed - S::constant(self.slip_scale.powi(2));
        let stick = (-slip2 / (stribeck_speed * stribeck_speed)).exp();
        kinetic + (friction - kinetic) * stick
    }

    #[inline]
    fn slip_scale(&self) -> f64 {
        self.slip_scale
    }
}

impl FrictionLaw for Stribeck {
    #[inline]
    fn force<S: Scalar>(
        &self,
        p: [S; 3],
        normal_force: S,
        contact: &ContactKinematics<S>,
    ) -> Vector3<S> {
        self.isotropic_force(p, normal_force, &contact.slip)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::law_checks::{Claims, check_law};
    use crate::contact::{ApproachDamped, Hertz, NormalLaw};
    use crate::{ContactLaw, HuntCrossley, KelvinVoigt, Law};

    const FRICTION: Stribeck =
        Stribeck { friction: 0.6, kinetic_friction: 0.35, stribeck_speed: 0.05, slip_scale: 1e-2 };

    #[test]
    fn every_law_keeps_its_promises_with_stick_slip() {
        fn check(normal: impl NormalLaw, claims: &Claims) {
            check_law(&Law::new(normal, FRICTION).unwrap(), claims);
        }
        let claims = Claims::new(0.6);
        let (stiffness, damping) = (3e7, 2e5);
        check(KelvinVoigt { stiffness, damping }, &claims);
        let kinked = Claims { smooth_at_rest: false, ..claims };
        check(ApproachDamped { stiffness, damping }, &kinked);
        check(Hertz { stiffness: 4e8 }, &claims);
        check(HuntCrossley { stiffness: 4e8, damping: 0.8, exponent: 1.5 }, &claims);
    }

    #[test]
    fn friction_falls_from_static_to_kinetic() {
        let friction = Stribeck {
            friction: 0.6,
            kinetic_friction: 0.4,
            stribeck_speed: 1e-2,
            slip_scale: 1e-6,
        };
        let law = Law::new(KelvinVoigt { stiffness: 1e7, damping: 0.0 }, friction).unwrap();
        let ratio = |speed: f64| {
            let slip = Vector3::new(speed, 0.0, 0.0);
            let contact = ContactKinematics {
                gap: -1e-3,
                normal_speed: 0.0,
                slip,
                normal: Vector3::z(),
                area: 1e-4,
            };
            let response = law.law(law.params(), &contact);
            response.tangential.norm() / response.normal
        };
        assert!((ratio(1e-4) - 0.6).abs() < 1e-4);
        assert!((ratio(1e-2) - (0.4 + 0.2 * (-1f64).exp())).abs() < 1e-8);
        assert!((ratio(1.0) - 0.4).abs() < 1e-8);
    }

    #[test]
    fn bad_parameters_are_named() {
        let law = Law::new(Hertz { stiffness: 1e7 }, FRICTION).unwrap();
        for (kinetic_friction, stribeck_speed, name) in [
            (-0.1, 1e-2, "kinetic_friction"),
            (0.7, 1e-2, "kinetic_friction"),
            (f64::NAN, 1e-2, "kinetic_friction"),
            (0.4, 0.0, "stribeck_speed"),
        ] {
            let friction = Stribeck { kinetic_friction, stribeck_speed, ..FRICTION };
            let refused = Law::new(Hertz { stiffness: 1e7 }, friction).unwrap_err();
            assert_eq!(refused.name(), Some(name));
            let later = law.check(&[1e7, 0.6, kinetic_friction, stribeck_speed]).unwrap_err();
            assert_eq!(later.name(), Some(name));
        }
    }
}
