//! Stiffness and damping of a contact from a body at rest on it.

use super::error::LawError;
use super::range::ParameterRange;

/// A body at rest on a contact, from which laws get their stiffness and damping per area.
///
/// The coefficient of restitution that `from_target` of a law takes is that of an impact without gravity
/// ([`restitution`](crate::contact::restitution)). Under gravity it holds for impacts far faster than √(g δ) for the depth δ at
/// rest; slower ones bounce less, and at last not at all. Fast ones go deep ([`ContactCalibration::impact_depth`]): a field
/// must have that depth to give, and a corner, whose area is small, goes several times as deep as all of the area together.
///
/// ```
/// use prehend_sim::{ContactCalibration, KelvinVoigt};
///
/// // 300 g on 4 cm², half a millimeter deep, that bounces back at 45 % of its speed.
/// let target =
///     ContactCalibration { mass: 0.3, gravity: 9.81, penetration: 5e-4, contact_area: 4e-4 };
/// let law = KelvinVoigt::from_target(&target, 0.45)?;
/// // At 1 m/s it goes 7 mm deep at most.
/// assert!((target.impact_depth(1.0, 1.0) - 7.1e-3).abs() < 1e-4);
/// # Ok::<(), prehend_sim::contact::LawError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactCalibration {
    /// Mass of the body \[kg\].
    pub mass: f64,
    /// Gravity across the contact \[m/s²\].
    pub gravity: f64,
    /// Depth to which the body sinks in \[m\], usually 0.2–1 mm.
    pub penetration: f64,
    /// Area of the samples that touch \[m²\]: what [`Surface`](crate::Surface) says of those that carry the body at rest. A lattice
    /// on a box has that of the face, a single round sample, such as [`Surface::ball`](crate::Surface::ball), its own. A ball of
    /// radius R with samples all over it that sinks in by d stands on 2πRd, at half of the depth in the mean: for a law that is linear
    /// in depth that is πRd.
    pub contact_area: f64,
}

impl ContactCalibration {
    /// Checks that every field is positive.
    ///
    /// # Errors
    /// Names the field that is not.
    pub fn check(&self) -> Result<(), LawError> {
        ParameterRange::Positive.check("mass", self.mass)?;
        ParameterRange::Positive.check("gravity", self.gravity)?;
        ParameterRange::Positive.check("penetration", self.penetration)?;
        ParameterRange::Positive.check("contact_area", self.contact_area)
    }

    /// Stiffness per area K = m g/(A δⁿ) \[N/m^{2+n}\] of a law whose pressure is K dⁿ.
    pub fn stiffness(&self, exponent: f64) -> f64 {
        self.mass * self.gravity / (self.penetration.powf(exponent) * self.contact_area)
    }

    /// Depth \[m\] of a body that hits the contact with `speed` \[m/s\] on the same area, if a law whose pressure is K dⁿ
    /// does not damp it: ((n + 1) v² δⁿ/2g)^{1/(n+1)}, v√(δ/g) where pressure is linear. Gravity adds about δ, damping takes away.
    pub fn impact_depth(&self, speed: f64, exponent: f64) -> f64 {
        // m v²/2 = K A dⁿ⁺¹/(n + 1), and K A = m g/δⁿ.
        let power =
            0.5 * (exponent + 1.0) * speed * speed * self.penetration.powf(exponent) / self.gravity;
        power.powf((exponent + 1.0).recip())
    }

    /// Stiffness and damping per area of a linear law that bounces with coefficient `restitution`, for which `ratio` is the
    /// damping ratio.
    pub(super) fn bouncing(
        &self,
        restitution: f64,
        ratio: fn(f64) -> f64,
    ) -> Result<[f64; 2], LawError> {
        self.check()?;
        ParameterRange::PositiveFraction.check("restitution", restitution)?;
        Ok([self.stiffness(1.0), self.damping(ratio(restitution))])
    }

    /// Damping per area D = 2ζ√(K m/A) \[N s/m³\] of a linear law for the damping ratio ζ.
    pub fn damping(&self, ratio: f64) -> f64 {
        2.0 * ratio * (self.stiffness(1.0) * self.mass / self.contact_area).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::law_checks::{TARGET, load};
    use crate::contact::{ApproachDamped, Bounce, Hertz, NormalLaw};
    use crate::{Coulomb, HuntCrossley, KelvinVoigt, Law};

    #[test]
    fn every_law_carries_the_weight_however_finely_the_surface_is_sampled() {
        fn check(normal: Result<impl NormalLaw, LawError>) {
            let friction = Coulomb { friction: 0.5, slip_scale: 1e-3 };
            let law = Law::new(normal.unwrap(), friction).unwrap();
            for samples in [1u32, 4, 8, 2000] {
                let count = f64::from(samples);
                let one = load(&law, TARGET.contact_area / count, TARGET.penetration);
                assert!((count * one / (TARGET.mass * TARGET.gravity) - 1.0).abs() < 1e-12);
            }
        }
        check(KelvinVoigt::from_target(&TARGET, 0.3));
        check(ApproachDamped::from_target(&TARGET, 0.3));
        check(Hertz::from_target(&TARGET));
        let bounce = Bounce { restitution: 0.5, impact_speed: 1.0 };
        check(HuntCrossley::from_target(&TARGET, 2.0, bounce));
    }

    #[test]
    fn an_impact_ends_where_its_energy_is_stored() {
        for (exponent, speed) in [(1.0, 1.0), (1.5, 0.3), (2.2, 2.0)] {
            let depth = TARGET.impact_depth(speed, exponent);
            let (stiffness, cells) = (TARGET.stiffness(exponent) * TARGET.contact_area, 10_000);
            let middle = |i: i32| depth * (f64::from(i) + 0.5) / f64::from(cells);
            let stored: f64 = (0..cells).map(|i| stiffness * middle(i).powf(exponent)).sum();
            let stored = stored * depth / f64::from(cells);
            assert!((stored / (0.5 * TARGET.mass * speed * speed) - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn bad_fields_are_named() {
        let names = ["mass", "gravity", "penetration", "contact_area"];
        for (k, name) in names.into_iter().enumerate() {
            for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
                let mut x = [0.3, 9.81, 5e-4, 4e-4];
                x[k] = bad;
                let [mass, gravity, penetration, contact_area] = x;
                let target = ContactCalibration { mass, gravity, penetration, contact_area };
                assert_eq!(target.check().unwrap_err().name(), Some(name));
                assert!(Hertz::from_target(&target).is_err());
            }
        }
    }
}
