//! A contact law as the product of a normal law and a friction law.

use prehend_autodiff::Scalar;

use super::bristles::Bristles;
use super::error::LawError;
use super::friction::FrictionLaw;
use super::law::ContactLaw;
use super::normal::NormalLaw;
use super::parameters::{ParameterArray, Parameters};
use super::point::{ContactForce, ContactKinematics};

/// A normal law N × a friction law F.
///
/// Its parameters are those of the normal law, then those of the friction law.
///
/// ```
/// use prehend_sim::{ContactLaw, Coulomb, KelvinVoigt, Law};
///
/// let spring = KelvinVoigt { stiffness: 2e7, damping: 1e4 };
/// let law = Law::new(spring, Coulomb { friction: 0.5, slip_scale: 1e-3 })?;
/// assert_eq!(law.params(), [2e7, 1e4, 0.5]);
/// # Ok::<(), prehend_sim::contact::LawError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Law<N, F> {
    normal: N,
    friction: F,
    /// Values of both.
    params: Vec<f64>,
}

impl<N: NormalLaw, F: FrictionLaw> Law<N, F> {
    /// The law with these parts.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(normal: N, friction: F) -> Result<Self, LawError> {
        let values = (normal.values(), friction.values());
        normal.check(&values.0)?;
        friction.check(&values.1)?;
        Ok(Self { normal, friction, params: values.to_vec() })
    }
}

/// The parameters of both parts.
type Params<N, F, T> = (<N as Parameters>::Params<T>, <F as Parameters>::Params<T>);

impl<N: NormalLaw, F: FrictionLaw> ContactLaw for Law<N, F> {
    #[inline]
    fn params(&self) -> &[f64] {
        &self.params
    }

    fn param_names(&self) -> Vec<&'static str> {
        [self.normal.names(), self.friction.names()].concat()
    }

    #[inline]
    fn law<S: Scalar>(&self, p: &[S], contact: &ContactKinematics<S>) -> ContactForce<S> {
        let Some(((p_normal, p_friction), [])) = Params::<N, F, S>::split(p) else {
            return ContactForce::nan();
        };
        let normal = self.normal.force(p_normal, contact);
        ContactForce { normal, tangential: self.friction.force(p_friction, normal, contact) }
    }

    #[inline]
    fn cutoff(&self) -> f64 {
        self.normal.cutoff()
    }

    fn bristles(&self) -> Option<Bristles> {
        self.friction.bristles()
    }

    fn check(&self, p: &[f64]) -> Result<(), LawError> {
        let Some(((p_normal, p_friction), [])) = Params::<N, F, f64>::split(p) else {
            return Err(LawError::Count { given: p.len(), expected: self.params.len() });
        };
        self.normal.check(&p_normal)?;
        self.friction.check(&p_friction)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::{Coulomb, KelvinVoigt};

    #[test]
    fn a_wrong_number_of_parameters_is_an_error_and_never_no_force() {
        let spring = KelvinVoigt { stiffness: 1e6, damping: 1e3 };
        let law = Law::new(spring, Coulomb { friction: 0.5, slip_scale: 1e-3 }).unwrap();
        let (slip, normal) = (Vector3::x(), Vector3::z());
        let contact = ContactKinematics { gap: -1e-3, normal_speed: 0.0, slip, normal, area: 1e-4 };
        for given in [0, 1, 2, 4] {
            let p = vec![1.0; given];
            assert_eq!(law.check(&p), Err(LawError::Count { given, expected: 3 }));
            let ContactForce { normal, tangential } = law.law(&p, &contact);
            assert!(normal.is_nan() && tangential.iter().all(|f| f.is_nan()));
        }
        assert_eq!(law.check(law.params()), Ok(()));
    }
}
