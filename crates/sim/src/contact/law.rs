//! Interface that a contact law implements.

use prehend_autodiff::Scalar;

use super::bristles::Bristles;
use super::error::LawError;
use super::point::{ContactForce, ContactKinematics};

/// A contact law: one function, generic over the scalar, from which come forces and derivatives.
///
/// A response must vanish where the gap equals [`cutoff`](Self::cutoff) and its rate is zero. [`Law`](super::composite::Law)
/// makes one of a normal law and a friction law. A frictionless law whose pressure grows with the square of the depth:
///
/// ```
/// use nalgebra::Vector3;
/// use prehend_autodiff::Scalar;
/// use prehend_sim::{ContactForce, ContactKinematics, ContactLaw};
///
/// struct Quadratic([f64; 1]);
///
/// impl ContactLaw for Quadratic {
///     fn params(&self) -> &[f64] {
///         &self.0
///     }
///     fn law<S: Scalar>(&self, p: &[S], contact: &ContactKinematics<S>) -> ContactForce<S> {
///         let normal = p[0] * contact.gap * contact.gap * contact.area;
///         ContactForce { normal, tangential: Vector3::zeros() }
///     }
///     fn cutoff(&self) -> f64 {
///         0.0
///     }
/// }
///
/// let (gap, area) = (-1e-3, 1e-4);
/// let contact =
///     ContactKinematics { gap, normal_speed: 0.0, slip: Vector3::zeros(), normal: Vector3::z(), area };
/// let law = Quadratic([1e10]);
/// assert!((law.law(law.params(), &contact).normal - 1.0).abs() < 1e-12);
/// ```
pub trait ContactLaw: Send + Sync {
    /// Values of the parameters that may carry derivatives (stiffness, friction, …).
    fn params(&self) -> &[f64] {
        &[]
    }

    /// Names of the parameters, in the order of [`params`](Self::params): empty where they have no name.
    fn param_names(&self) -> Vec<&'static str> {
        vec![""; self.params().len()]
    }

    /// Force of one contact. `p` are the parameters, as many as [`params`](Self::params), with their derivatives; the laws
    /// of this crate answer NaN to any other number of them.
    fn law<S: Scalar>(&self, p: &[S], contact: &ContactKinematics<S>) -> ContactForce<S>
    where
        Self: Sized;

    /// Gap beyond which value and derivative are zero \[m\].
    fn cutoff(&self) -> f64;

    /// Tangential springs that make contacts hold; none, and friction knows nothing of what was. With them, `slip` is that of
    /// the contact and of its springs.
    fn bristles(&self) -> Option<Bristles> {
        None
    }

    /// Checks that `p`, finite numbers as many as [`params`](Self::params), are in their ranges.
    ///
    /// # Errors
    /// Names the parameter that is not.
    fn check(&self, _p: &[f64]) -> Result<(), LawError> {
        Ok(())
    }
}
