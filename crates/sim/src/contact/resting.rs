//! What one knows of a contact: the body that rests on it.

use super::error::LawError;

/// A body at rest on a contact, from which laws get their stiffness and damping per area.
///
/// ```
/// use prehend_sim::{Penalty, RestingContact};
///
/// // 300 g on 4 cm², half a millimeter deep, that bounces back at 45 % of its speed.
/// let resting =
///     RestingContact { mass: 0.3, gravity: 9.81, penetration: 5e-4, contact_area: 4e-4 };
/// let law = Penalty::from_resting(&resting, 0.45, 0.5, 1e-3)?;
/// # Ok::<(), prehend_sim::LawError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestingContact {
    /// Mass of the body \[kg\].
    pub mass: f64,
    /// Gravity across the contact \[m/s²\].
    pub gravity: f64,
    /// How deep the body sinks in \[m\], usually 0.2–1 mm.
    pub penetration: f64,
    /// Area of the samples that touch \[m²\].
    pub contact_area: f64,
}

impl RestingContact {
    /// Checks that every field is positive.
    ///
    /// # Errors
    /// Names the field that is not.
    pub fn check(&self) -> Result<(), LawError> {
        LawError::check_positive("mass", self.mass)?;
        LawError::check_positive("gravity", self.gravity)?;
        LawError::check_positive("penetration", self.penetration)?;
        LawError::check_positive("contact_area", self.contact_area)
    }

    /// Stiffness per area K = m g/(A δⁿ) \[N/m^{2+n}\] of a law whose pressure is K dⁿ.
    pub fn stiffness(&self, exponent: f64) -> f64 {
        self.mass * self.gravity / (self.penetration.powf(exponent) * self.contact_area)
    }

    /// Stiffness and damping per area of a linear law that bounces with coefficient `restitution`, as which damping ratio
    /// `ratio` says.
    pub(super) fn bouncing(
        &self,
        restitution: f64,
        ratio: fn(f64) -> f64,
    ) -> Result<[f64; 2], LawError> {
        self.check()?;
        LawError::check_restitution(restitution)?;
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
    use crate::contact::law_checks::load;
    use crate::{ApproachPenalty, HertzPenalty, HuntCrossleyPenalty, Penalty};

    const RESTING: RestingContact =
        RestingContact { mass: 0.3, gravity: 9.81, penetration: 5e-4, contact_area: 4e-4 };

    #[test]
    fn every_law_carries_the_weight_however_finely_the_surface_is_sampled() {
        let penalty = Penalty::from_resting(&RESTING, 0.3, 0.5, 1e-3).unwrap();
        let approach = ApproachPenalty::from_resting(&RESTING, 0.3, 0.5, 1e-3).unwrap();
        let hertz = HertzPenalty::from_resting(&RESTING, 0.5, 1e-3).unwrap();
        let hunt = HuntCrossleyPenalty::from_resting(&RESTING, 2.0, 0.5, 1.0, 0.5, 1e-3).unwrap();
        for samples in [1u32, 4, 8, 2000] {
            let count = f64::from(samples);
            let area = RESTING.contact_area / count;
            let depth = RESTING.penetration;
            let loads = [
                load(&penalty, area, depth),
                load(&approach, area, depth),
                load(&hertz, area, depth),
                load(&hunt, area, depth),
            ];
            for one in loads {
                assert!((count * one / (RESTING.mass * RESTING.gravity) - 1.0).abs() < 1e-12);
            }
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
                let resting = RestingContact { mass, gravity, penetration, contact_area };
                assert_eq!(resting.check().unwrap_err().name, name);
                assert!(HertzPenalty::from_resting(&resting, 0.5, 1e-3).is_err());
            }
        }
    }
}
