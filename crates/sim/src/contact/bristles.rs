//! Tangential springs: what makes a contact hold.

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

use super::error::LawError;
use super::range::ParameterRange;

/// Tangential springs of a contact with bristles, as in P. A. Cundall and O. D. L. Strack, "A discrete numerical model for granular
/// assemblies", Géotechnique 29, 1979, and C. Canudas de Wit et al., "A new model for control of systems with friction", IEEE
/// Trans. Automatic Control 40, 1995, with one deflection for all samples of a pair.
///
/// The deflection is a twist ζ of the body with the samples against the field. It deflects a sample at l from the center of mass
/// by u = P(ζ_v + ζ_ω×l), across the normal. The law sees the slip s + u v_b/u_b for the deflection u_b and the slip speed v_b of
/// full friction. Bristles follow the slip and yield as they near full deflection:
///
/// u' = v_b/√(s² + v_b²)·s − v_b s²/(s² + v_b²)·(|u|/u_b)⁴ u/u_b,
///
/// in the mean over the samples, weighted by area and depth. Without slip nothing yields: what sticks does not creep. No
/// rate is faster than 5 v_b/u_b, whatever the slip. Without contact they return to zero in u_b/v_b, and begin to where the mean
/// depth is less than u_b/1000: a body has to rest deeper than that to be held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bristles {
    /// Deflection of full friction u_b \[m\].
    pub deflection: f64,
    /// Slip that the full deflection counts as, v_b \[m/s\].
    pub slip_speed: f64,
}

impl Bristles {
    /// Checks that both numbers are positive.
    pub(crate) fn check(&self) -> Result<(), LawError> {
        let range = ParameterRange::Positive;
        range.check("deflection of bristles", self.deflection)?;
        range.check("slip speed of bristles", self.slip_speed)
    }

    /// The fastest rate at which they yield \[1/s\].
    pub(crate) fn fastest(&self) -> f64 {
        5.0 * self.slip_speed / self.deflection
    }

    /// Slip that the law sees of bristles deflected by u \[m/s\].
    pub(crate) fn slip<T: Scalar>(&self, deflected: &Vector3<T>) -> Vector3<T> {
        deflected.map(|u| u.times(self.slip_speed / self.deflection))
    }

    /// u' of bristles deflected by u and slip.
    pub(super) fn rate<T: Scalar>(&self, slip: &Vector3<T>, deflected: &Vector3<T>) -> Vector3<T> {
        let (s2, u2) = (slip.dot(slip), deflected.dot(deflected));
        let squares = s2.plus(self.slip_speed.powi(2));
        let follow = T::constant(self.slip_speed) / squares.sqrt();
        let yields = (s2 / squares * u2 * u2).times(self.slip_speed / self.deflection.powi(5));
        slip * follow - deflected * yields
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_rate_is_faster_than_that_of_full_deflection_and_fast_slip() {
        let bristles = Bristles { deflection: 2e-4, slip_speed: 3e-3 };
        let rate = |slip: f64, deflected: f64| {
            let by = |u: f64| bristles.rate(&(Vector3::x() * slip), &(Vector3::x() * u)).x;
            (by(deflected + 1e-9) - by(deflected - 1e-9)) / 2e-9
        };
        let full = -rate(1e3, bristles.deflection);
        assert!((full / bristles.fastest() - 1.0).abs() < 1e-4, "{full}");
        for slip in [0.0, 1e-3, 1.0] {
            for share in [0.0, 0.5, 0.99] {
                assert!(-rate(slip, share * bristles.deflection) < bristles.fastest());
            }
        }
    }
}
