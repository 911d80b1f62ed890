//! The normal law of Hunt and Crossley, per area.

use prehend_autodiff::Scalar;

use super::NormalLaw;
use crate::contact::calibration::ContactCalibration;
use crate::contact::error::LawError;
use crate::contact::parameters::{Parameters, law_part};
use crate::contact::point::ContactKinematics;
use crate::contact::range::ParameterRange;
use crate::contact::restitution::hunt_crossley_damping;

law_part! {
    /// A power-law spring whose damping grows with the load: f_n = A·K·dⁿ·max(0, 1 + c ḋ) for depth d = −g
    /// (K. H. Hunt and F. R. E. Crossley, "Coefficient of restitution interpreted as damping in vibroimpact",
    /// J. Applied Mechanics 42, 1975).
    ///
    /// Unlike with a linear damper the force starts from zero at any speed, so contact begins without a jump; for
    /// n > 1 it begins without a kink too, and leaky smoothing has nothing to leak. It bounces with
    /// [`hunt_crossley_restitution`](crate::contact::restitution::hunt_crossley_restitution), whatever K and n. A free
    /// rebound never reaches the clamp; bodies that are pulled apart do.
    pub struct HuntCrossley: "power-law spring damped in proportion to its load" {
        stiffness ["N/m^(2+n)"] Positive "pressure per depth^n";
        damping ["s/m"] NotNegative "share of load per approach speed";
        exponent [""] AtLeastOne "power n of the depth, at least 1";
    }
}

/// Restitution of a contact at an impact speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounce {
    /// Coefficient of restitution, above 0 and at most 1.
    pub restitution: f64,
    /// Speed of the impact \[m/s\], positive. Slower ones bounce more.
    pub impact_speed: f64,
}

impl HuntCrossley {
    /// The law of this `exponent` with which the body of `target` rests at its depth, and bounces as `bounce` says in an impact without
    /// gravity, see [`ContactCalibration`].
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn from_target(
        target: &ContactCalibration,
        exponent: f64,
        bounce: Bounce,
    ) -> Result<Self, LawError> {
        let Bounce { restitution, impact_speed } = bounce;
        target.check()?;
        ParameterRange::PositiveFraction.check("restitution", restitution)?;
        ParameterRange::Positive.check("impact_speed", impact_speed)?;
        ParameterRange::AtLeastOne.check("exponent", exponent)?;
        let damping = hunt_crossley_damping(restitution, impact_speed);
        let law = Self { stiffness: target.stiffness(exponent), damping, exponent };
        law.check(&law.values()).map(|()| law)
    }
}

impl NormalLaw for HuntCrossley {
    #[inline]
    fn force<S: Scalar>(&self, p: [S; 3], contact: &ContactKinematics<S>) -> S {
        let [stiffness, damping, exponent] = p;
        let depth = -contact.gap;
        let load = S::one() - damping * contact.normal_speed;
        if depth.value() < 0.0 || load.value() <= 0.0 {
            return S::zero();
        }
        stiffness * depth.powf(exponent) * load * contact.area
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Hertz;
    use crate::contact::law_checks::{Claims, TARGET, bounce, check_law, frictionless, load};
    use crate::{Coulomb, Law};

    #[test]
    fn keeps_what_laws_promise() {
        let law = |exponent| {
            let normal = HuntCrossley { stiffness: 4e8, damping: 0.8, exponent };
            Law::new(normal, Coulomb { friction: 0.6, slip_scale: 1e-2 })
        };
        for exponent in [1.0, 1.5, 2.2] {
            check_law(&law(exponent).unwrap(), &Claims::new(0.6));
        }
        let error = law(0.9).unwrap_err();
        assert_eq!(error.to_string(), "exponent must be at least 1, is 0.9");
    }

    #[test]
    fn undamped_with_three_halves_is_hertz() {
        let (stiffness, damping, exponent) = (4e8, 0.0, 1.5);
        let law = frictionless(Ok(HuntCrossley { stiffness, damping, exponent }));
        let hertz = frictionless(Ok(Hertz { stiffness }));
        assert!((load(&law, 1e-4, 3e-4) / load(&hertz, 1e-4, 3e-4) - 1.0).abs() < 1e-14);
    }

    #[test]
    fn rests_and_bounces_as_told_whatever_the_exponent() {
        for (exponent, e) in [(1.0, 0.8), (1.5, 0.5), (2.5, 0.2)] {
            let bounces = Bounce { restitution: e, impact_speed: 0.5 };
            let law = frictionless(HuntCrossley::from_target(&TARGET, exponent, bounces));
            assert!((load(&law, 4e-4, 5e-4) - 0.3 * 9.81).abs() < 1e-12);
            let measured = bounce(&law, &TARGET, 0.5);
            assert!((measured - e).abs() < 3e-4, "{exponent}: {measured} for {e}");
        }
    }
}
