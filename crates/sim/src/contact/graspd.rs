//! The contact law of Grasp'D.

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

use super::error::LawError;
use super::law::ContactLaw;
use super::parameters::{ParameterArray, Parameters, law_part};
use super::point::{ContactForce, ContactKinematics};

law_part! {
    /// Parameters of [`GraspD`].
    pub struct GraspDParameters: "spring per sample with the friction of Grasp'D" {
        stiffness ["N/m"] Positive "force per depth of a sample";
        gain ["N s/m^2"] NotNegative "friction per slip speed and depth";
        friction [""] NotNegative "friction coefficient";
    }
    constants {
        offset ["m"] Finite "distance at which contact begins";
    }
}

impl Default for GraspDParameters {
    /// The published ones: k_n = 1e5, k_f = 1e3, μ = 0.5, ρ = 0.
    fn default() -> Self {
        Self { stiffness: 1e5, gain: 1e3, friction: 0.5, offset: 0.0 }
    }
}

/// The penalty law of Grasp'D (D. Turpin et al., ECCV 2022), a spring per sample: with c = min(φ − ρ, 0),
/// f_n = −k_n c and f_t = −(u/|u|)·min(k_f |u| |c|, μ k_n |c|), for the stiffness k_n, gain k_f and offset ρ.
///
/// Sample areas are ignored, so forces grow with the number of samples. Friction depends on the depth, not on the normal force
/// alone, so that this law is no product of two. Its leaky gradient is
/// [`GapSmoothing::grasp_d`](super::gap_smoothing::GapSmoothing::grasp_d). There, at c = 0, both sides of the minimum
/// are zero: the derivative used is that of a contact that just begins, k_f|u| or μ k_n, whichever is less; the authors'
/// code always takes μ k_n.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GraspD {
    parameters: GraspDParameters,
    params: [f64; 3],
}

impl GraspD {
    /// The law with these parameters.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(parameters: GraspDParameters) -> Result<Self, LawError> {
        let params = parameters.values();
        parameters.check(&params)?;
        Ok(Self { parameters, params })
    }
}

impl ContactLaw for GraspD {
    #[inline]
    fn params(&self) -> &[f64] {
        &self.params
    }

    fn param_names(&self) -> Vec<&'static str> {
        self.parameters.names()
    }

    #[inline]
    fn law<S: Scalar>(&self, p: &[S], contact: &ContactKinematics<S>) -> ContactForce<S> {
        let &[stiffness, gain, friction] = p else {
            return ContactForce::nan();
        };
        let depth = S::constant(self.parameters.offset) - contact.gap;
        // Zero counts as active: leaky smoothing differentiates a contact of exactly zero force.
        if depth.value() < 0.0 {
            return ContactForce::zero();
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
        ContactForce { normal: stiffness * depth, tangential }
    }

    #[inline]
    fn cutoff(&self) -> f64 {
        self.parameters.offset
    }

    fn check(&self, p: &[f64]) -> Result<(), LawError> {
        match ParameterArray::split(p) {
            Some((p, [])) => self.parameters.check(&p),
            _ => Err(LawError::Count { given: p.len(), expected: self.params.len() }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::law_checks::{Claims, check_law};

    #[test]
    fn keeps_what_laws_promise() {
        check_law(&GraspD::new(GraspDParameters::default()).unwrap(), &Claims::new(0.5));
        let (stiffness, gain, friction) = (2e4, 1e5, 0.8);
        for offset in [2e-3, -2e-3] {
            let parameters = GraspDParameters { stiffness, gain, friction, offset };
            check_law(&GraspD::new(parameters).unwrap(), &Claims::new(0.8));
        }
    }

    #[test]
    fn forces_are_the_published_formula() {
        let parameters = GraspDParameters { offset: 2e-3, ..GraspDParameters::default() };
        let law = GraspD::new(parameters).unwrap();
        for speed in [0.0, 10.0, 49.0, 51.0, 300.0] {
            let slip = Vector3::new(0.0, speed, 0.0);
            let contact = ContactKinematics {
                gap: 1e-3,
                normal_speed: -1.0,
                slip,
                normal: Vector3::x(),
                area: 1.0,
            };
            let response = law.law(law.params(), &contact);
            assert!((response.normal - 100.0).abs() < 1e-9);
            let expected = (1e3 * speed * 1e-3).min(0.5 * 1e5 * 1e-3);
            assert!((response.tangential.y + expected).abs() < 1e-9);
            assert!(response.tangential.norm() <= 0.5 * response.normal + 1e-9);
        }
    }
}
