//! Hertz's elastic normal law, per area.

use prehend_autodiff::Scalar;

use super::NormalLaw;
use crate::contact::calibration::ContactCalibration;
use crate::contact::error::LawError;
use crate::contact::parameters::{Parameters, law_part};
use crate::contact::point::ContactKinematics;

law_part! {
    /// An elastic contact that stiffens with depth d = −g: f_n = A·K·d^{3/2}.
    ///
    /// The exponent is that of two touching spheres (H. Hertz, 1882; K. L. Johnson, Contact Mechanics, §4.2),
    /// whose whole contact has F = 4/3 E* √R d^{3/2}: one sample with A·K = 4/3 E* √R reproduces it. Spread over
    /// the samples of a finely sampled surface it is an elastic foundation of the same exponent.
    ///
    /// Force and stiffness are both zero at d = 0 and continuous there, so a contact begins without a kink, and leaky
    /// smoothing has nothing to leak. It does not dissipate: [`HuntCrossley`](super::hunt_crossley::HuntCrossley)
    /// adds damping.
    pub struct Hertz: "elastic contact of force depth^1.5" {
        stiffness ["N/m^3.5"] Positive "pressure per depth^1.5";
    }
}

impl Hertz {
    /// The law with which the body of `target` rests at its depth.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn from_target(target: &ContactCalibration) -> Result<Self, LawError> {
        target.check()?;
        let law = Self { stiffness: target.stiffness(1.5) };
        law.check(&law.values()).map(|()| law)
    }
}

impl NormalLaw for Hertz {
    #[inline]
    fn force<S: Scalar>(&self, [stiffness]: [S; 1], contact: &ContactKinematics<S>) -> S {
        let depth = -contact.gap;
        // The root's slope is infinite at zero, that of d^{3/2} is zero there.
        if depth.value() <= 0.0 {
            return S::zero();
        }
        stiffness * depth * depth.sqrt() * contact.area
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::law_checks::{Claims, TARGET, bounce, check_law, frictionless, load};
    use crate::{Coulomb, Law};

    #[test]
    fn keeps_what_laws_promise() {
        let law =
            |stiffness| Law::new(Hertz { stiffness }, Coulomb { friction: 0.3, slip_scale: 1e-2 });
        check_law(&law(4e8).unwrap(), &Claims::new(0.3));
        assert_eq!(law(0.0).unwrap_err().name(), Some("stiffness"));
    }

    #[test]
    fn carries_the_weight_at_the_target_depth_and_bounces_fully() {
        let law = frictionless(Hertz::from_target(&TARGET));
        assert!((load(&law, 4e-4, 5e-4) - 0.3 * 9.81).abs() < 1e-12);
        assert!((bounce(&law, &TARGET, 0.5) - 1.0).abs() < 2e-4);
    }

    #[test]
    fn is_the_force_of_two_spheres() {
        // Steel ball of 10 mm on steel, 1 µm deep: 4/3·115 GPa·√(10 mm)·(1 µm)^{3/2}.
        let stiffness = 4.0 / 3.0 * 115e9 * 0.01f64.sqrt();
        let law = frictionless(Ok(Hertz { stiffness }));
        assert!((load(&law, 1.0, 1e-6) - 15.333_333_333).abs() < 1e-8);
    }
}
