//! The contact law of Grasp'D.

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

use super::error::LawError;
use super::law::{Contact, ContactLaw, Response};

/// The penalty law of Grasp'D (D. Turpin et al., ECCV 2022), a spring per sample:
/// with c = min(φ − ρ, 0), f_n = −k_n c and f_t = −(u/|u|)·min(k_f |u| |c|, μ k_n |c|).
///
/// Sample areas are ignored, so forces grow with the number of samples. Its leaky gradient is
/// [`Onset::grasp_d`](super::onset::Onset::grasp_d). There, at c = 0, both sides of the minimum are zero: the
/// derivative used is that of a contact that just begins, k_f|u| or μ k_n, whichever is less; the authors'
/// code always takes μ k_n.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GraspD {
    /// Normal stiffness k_n \[N/m\], friction gain k_f \[N s/m²\], friction coefficient μ.
    pub params: [f64; 3],
    /// Distance ρ at which contact begins \[m\].
    pub offset: f64,
}

impl GraspD {
    /// `stiffness` \[N/m\] > 0, friction `gain` \[N s/m²\] ≥ 0, `friction` coefficient ≥ 0, and the distance
    /// `offset` \[m\] at which contact begins.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(stiffness: f64, gain: f64, friction: f64, offset: f64) -> Result<Self, LawError> {
        LawError::check_positive("stiffness", stiffness)?;
        LawError::check_not_negative("gain", gain)?;
        LawError::check_not_negative("friction", friction)?;
        LawError::check_finite("offset", offset)?;
        Ok(Self { params: [stiffness, gain, friction], offset })
    }
}

impl Default for GraspD {
    /// The published constants k_n = 1e5, k_f = 1e3, μ = 0.5, ρ = 0.
    fn default() -> Self {
        Self { params: [1e5, 1e3, 0.5], offset: 0.0 }
    }
}

impl ContactLaw for GraspD {
    #[inline]
    fn params(&self) -> &[f64] {
        &self.params
    }

    #[inline]
    fn law<S: Scalar>(&self, p: &[S], contact: &Contact<S>) -> Response<S> {
        let &[stiffness, gain, friction] = p else {
            return Response::zero();
        };
        let depth = S::constant(self.offset) - contact.gap;
        // Zero counts as active: a leaky onset differentiates a contact of exactly zero force.
        if depth.value() < 0.0 {
            return Response::zero();
        }
        let [x, y, z] = [contact.slip.x, contact.slip.y, contact.slip.z];
        let speed2 = x * x + y * y + z * z;
        let (k, f) = (gain.value(), friction.value() * stiffness.value());
        // Compared squared, and divided by the speed only where it is the smaller: finite at rest.
        let scale = if k * k * speed2.value() <= f * f {
            gain * depth
        } else {
            friction * stiffness * depth / speed2.sqrt()
        };
        let tangential = Vector3::new(-(x * scale), -(y * scale), -(z * scale));
        Response { normal: stiffness * depth, tangential }
    }

    #[inline]
    fn reach(&self) -> f64 {
        self.offset
    }

    fn check(&self, p: &[f64]) -> Result<(), LawError> {
        Self::new(p[0], p[1], p[2], self.offset).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::law_checks::{Claims, check_law};

    #[test]
    fn keeps_what_laws_promise() {
        check_law(&GraspD::default(), &Claims::new(0.5));
        check_law(&GraspD::new(2e4, 1e5, 0.8, 2e-3).unwrap(), &Claims::new(0.8));
        check_law(&GraspD::new(2e4, 1e5, 0.8, -2e-3).unwrap(), &Claims::new(0.8));
    }

    #[test]
    fn forces_are_the_published_formula() {
        let law = GraspD { offset: 2e-3, ..GraspD::default() };
        for speed in [0.0, 10.0, 49.0, 51.0, 300.0] {
            let slip = Vector3::new(0.0, speed, 0.0);
            let contact =
                Contact { gap: 1e-3, normal_speed: -1.0, slip, normal: Vector3::x(), area: 1.0 };
            let response = law.law(&law.params, &contact);
            assert!((response.normal - 100.0).abs() < 1e-9);
            let expected = (1e3 * speed * 1e-3).min(0.5 * 1e5 * 1e-3);
            assert!((response.tangential.y + expected).abs() < 1e-9);
            assert!(response.tangential.norm() <= 0.5 * response.normal + 1e-9);
        }
    }
}
