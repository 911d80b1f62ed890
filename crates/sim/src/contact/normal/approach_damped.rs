//! The linear Kelvin–Voigt normal law whose damper acts on approach only.

use prehend_autodiff::Scalar;

use super::NormalLaw;
use crate::contact::calibration::ContactCalibration;
use crate::contact::error::LawError;
use crate::contact::parameters::{Parameters, law_part};
use crate::contact::point::ContactKinematics;
use crate::contact::restitution::approach_damping_ratio;

law_part! {
    /// Spring, and a damper that resists approach only: f_n = A·(−K g + D·max(0, −ġ)) for g ≤ 0, as in NVIDIA
    /// Warp's simulator.
    ///
    /// Contact lasts until the gap closes, without clamping: a body leaves as fast as the spring throws it. It
    /// bounces with [`approach_restitution`](crate::contact::restitution::approach_restitution).
    pub struct ApproachDamped: "linear spring, damper on approach only" {
        stiffness ["N/m^3"] Positive "pressure per depth";
        damping ["N s/m^3"] NotNegative "pressure per approach speed";
    }
}

impl ApproachDamped {
    /// The law with which the body of `target` rests at its depth, and bounces with coefficient `restitution`, above 0 and at
    /// most 1: that of an impact without gravity, see [`ContactCalibration`].
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn from_target(target: &ContactCalibration, restitution: f64) -> Result<Self, LawError> {
        let [stiffness, damping] = target.bouncing(restitution, approach_damping_ratio)?;
        let law = Self { stiffness, damping };
        law.check(&law.values()).map(|()| law)
    }
}

impl NormalLaw for ApproachDamped {
    #[inline]
    fn force<S: Scalar>(&self, [stiffness, damping]: [S; 2], contact: &ContactKinematics<S>) -> S {
        if contact.gap.value() > 0.0 {
            return S::zero();
        }
        // A still contact counts as approaching: its derivative then resists both ways.
        let approaching = contact.normal_speed.value() <= 0.0;
        let damper = if approaching { damping * contact.normal_speed } else { S::zero() };
        -(stiffness * contact.gap + damper) * contact.area
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::law_checks::{Claims, TARGET, bounce, check_law, frictionless};
    use crate::contact::restitution::approach_restitution;
    use crate::{Coulomb, Law};

    #[test]
    fn keeps_what_laws_promise() {
        let claims = Claims { smooth_at_rest: false, ..Claims::new(0.4) };
        let spring = ApproachDamped { stiffness: 3e7, damping: 2e5 };
        let law = Law::new(spring, Coulomb { friction: 0.4, slip_scale: 1e-2 }).unwrap();
        check_law(&law, &claims);
    }

    #[test]
    fn bounces_with_its_restitution() {
        // The last two are overdamped.
        for e in [0.9, 0.6715, 0.3, 0.1] {
            let law = frictionless(ApproachDamped::from_target(&TARGET, e));
            assert!((bounce(&law, &TARGET, 0.5) - e).abs() < 2e-4);
        }
        assert!((approach_restitution(0.3) - 0.6715).abs() < 5e-5);
        let error = ApproachDamped::from_target(&TARGET, 0.0).unwrap_err();
        assert_eq!(error.name(), Some("restitution"));
    }
}
