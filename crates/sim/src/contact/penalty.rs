//! The linear Kelvin–Voigt penalty law, per area, with Coulomb friction.

use prehend_autodiff::Scalar;
use thiserror::Error;

use super::law::{Contact, Isotropic, IsotropicLaw};

/// A contact-law parameter out of its range.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("{name} must be {range}, is {value}")]
pub struct LawError {
    /// Name of the parameter.
    pub name: &'static str,
    /// What it must be.
    pub range: &'static str,
    /// What it is.
    pub value: f64,
}

impl LawError {
    pub(super) fn check_positive(name: &'static str, value: f64) -> Result<(), Self> {
        let ok = value.is_finite() && value > 0.0;
        if ok { Ok(()) } else { Err(Self { name, range: "positive", value }) }
    }

    pub(super) fn check_not_negative(name: &'static str, value: f64) -> Result<(), Self> {
        let ok = value.is_finite() && value >= 0.0;
        if ok { Ok(()) } else { Err(Self { name, range: "zero or positive", value }) }
    }

    pub(super) fn check_finite(name: &'static str, value: f64) -> Result<(), Self> {
        if value.is_finite() { Ok(()) } else { Err(Self { name, range: "finite", value }) }
    }
}

/// Spring and damper per area, clamped so that contact never pulls:
/// f_n = A·max(0, −K g − D ġ), with friction coefficient μ.
///
/// Per area, so that forces do not depend on how many samples a surface carries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KelvinVoigt {
    /// Stiffness K \[N/m³\], damping D \[N s/m³\], friction coefficient μ.
    params: [f64; 3],
    slip_scale: f64,
}

/// [`KelvinVoigt`] as a contact law.
pub type Penalty = Isotropic<KelvinVoigt>;

impl Penalty {
    /// `stiffness` per area \[N/m³\] > 0, `damping` per area \[N s/m³\] ≥ 0, `friction` coefficient ≥ 0,
    /// and the slip speed `slip_scale` \[m/s\] > 0 that regularises friction.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(
        stiffness: f64,
        damping: f64,
        friction: f64,
        slip_scale: f64,
    ) -> Result<Self, LawError> {
        LawError::check_positive("stiffness", stiffness)?;
        LawError::check_not_negative("damping", damping)?;
        LawError::check_not_negative("friction", friction)?;
        LawError::check_positive("slip_scale", slip_scale)?;
        Ok(Isotropic(KelvinVoigt { params: [stiffness, damping, friction], slip_scale }))
    }
}

impl IsotropicLaw for KelvinVoigt {
    #[inline]
    fn params(&self) -> &[f64] {
        &self.params
    }

    #[inline]
    fn normal_force<S: Scalar>(&self, p: &[S], contact: &Contact<S>) -> S {
        let &[stiffness, damping, ..] = p else { return S::zero() };
        let pressure = -(stiffness * contact.gap + damping * contact.normal_speed);
        // Zero counts as active: a leaky onset differentiates a contact of exactly zero force.
        if pressure.value() >= 0.0 { pressure * S::constant(contact.area) } else { S::zero() }
    }

    #[inline]
    fn friction_coefficient<S: Scalar>(&self, p: &[S], _slip_speed: S) -> S {
        p.get(2).copied().unwrap_or_else(S::zero)
    }

    #[inline]
    fn slip_scale(&self) -> f64 {
        self.slip_scale
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::ContactLaw;

    #[test]
    fn bad_parameters_are_named() {
        let error = Penalty::new(-1.0, 0.0, 0.5, 1e-3).unwrap_err();
        assert_eq!(error.to_string(), "stiffness must be positive, is -1");
        assert_eq!(Penalty::new(1.0, 0.0, 0.5, 0.0).unwrap_err().name, "slip_scale");
        assert_eq!(Penalty::new(1.0, f64::NAN, 0.5, 1.0).unwrap_err().name, "damping");
    }

    #[test]
    fn contact_never_pulls() {
        let law = Penalty::new(1e6, 1e5, 0.5, 1e-3).unwrap();
        let slip = Vector3::new(0.1, 0.0, 0.0);
        let leaving =
            Contact { gap: -1e-3, normal_speed: 1.0, slip, normal: Vector3::z(), area: 1e-4 };
        let response = law.law(law.params(), &leaving);
        assert_eq!((response.normal, response.tangential.norm()), (0.0, 0.0));
        let resting = Contact { normal_speed: 0.0, ..leaving };
        assert!((law.law(law.params(), &resting).normal - 0.1).abs() < 1e-15);
    }
}
