//! What a contact-model author writes, and the object-safe form that the simulator calls.

use nalgebra::{Vector3, Vector6};
use prehend_autodiff::{Fwd, Scalar};

use super::error::LawError;
use super::friction::{regularized_coulomb, regularized_speed};
use super::patch::Patch;
use super::wrench::{self, WrenchJacobian};

/// One contact point, as a law sees it: vectors are along the axes of the body with the field (its model frame), which
/// for a held body at the identity are those of the world. Where two bodies touch both ways, each direction has the axes
/// of its own field's body.
#[derive(Clone, Copy, Debug)]
pub struct Contact<S: Scalar> {
    /// Effective gap after the [`Onset`](super::onset::Onset) \[m\], at most the law's reach; negative is
    /// penetration.
    pub gap: S,
    /// Rate of the effective gap \[m/s\], negative while approaching. The onset scales it too, so that
    /// damping fades in with contact and is zero without.
    pub normal_speed: S,
    /// Velocity of the sample's point across the normal, relative to the body with the field and along its axes
    /// \[m/s\].
    pub slip: Vector3<S>,
    /// Unit normal, out of the body with the field towards that with the sample, along the axes of the former.
    pub normal: Vector3<S>,
    /// Surface area the point stands for \[m²\].
    pub area: f64,
}

/// Force on the body with the sample at one contact point.
#[derive(Clone, Copy, Debug)]
pub struct Response<S: Scalar> {
    /// Force along the normal \[N\], positive pushes the body out.
    pub normal: S,
    /// Force across the normal, along the axes of the body with the field \[N\].
    pub tangential: Vector3<S>,
}

impl<S: Scalar> Response<S> {
    /// No force.
    #[inline]
    pub fn zero() -> Self {
        Self { normal: S::zero(), tangential: Vector3::zeros() }
    }
}

/// What a contact-model author writes: one function, generic over the scalar.
///
/// A response must vanish where the gap equals [`reach`](Self::reach)
/// and its rate is zero. A frictionless law whose pressure grows with the square of the depth:
///
/// ```
/// use nalgebra::Vector3;
/// use prehend_autodiff::Scalar;
/// use prehend_sim::{Contact, ContactLaw, Response};
///
/// struct Quadratic([f64; 1]);
///
/// impl ContactLaw for Quadratic {
///     fn params(&self) -> &[f64] {
///         &self.0
///     }
///     fn law<S: Scalar>(&self, p: &[S], contact: &Contact<S>) -> Response<S> {
///         let normal = p[0] * contact.gap * contact.gap * S::constant(contact.area);
///         Response { normal, tangential: Vector3::zeros() }
///     }
///     fn reach(&self) -> f64 {
///         0.0
///     }
/// }
///
/// let (gap, area) = (-1e-3, 1e-4);
/// let contact =
///     Contact { gap, normal_speed: 0.0, slip: Vector3::zeros(), normal: Vector3::z(), area };
/// let law = Quadratic([1e10]);
/// assert!((law.law(law.params(), &contact).normal - 1.0).abs() < 1e-12);
/// ```
pub trait ContactLaw: Send + Sync {
    /// Parameters that may carry derivatives (stiffness, friction, ...), passed back as `p`.
    fn params(&self) -> &[f64] {
        &[]
    }

    /// Force of one contact.
    fn law<S: Scalar>(&self, p: &[S], contact: &Contact<S>) -> Response<S>;

    /// Beyond this gap both value and derivative are zero \[m\].
    fn reach(&self) -> f64;

    /// Whether `p`, as many as [`params`](Self::params) and finite, are in their ranges.
    ///
    /// # Errors
    /// Names the parameter that is not.
    fn check(&self, _p: &[f64]) -> Result<(), LawError> {
        Ok(())
    }
}

/// An isotropic law: friction opposes slip, with a coefficient that may depend on its speed.
///
/// [`Isotropic`] makes a [`ContactLaw`] of it, with friction regularized and never outside the cone; it also
/// gives any of them stick–slip ([`Isotropic::with_stribeck`]) or anisotropic friction
/// ([`Isotropic::with_grain`]). A law whose pressure is that of an exponential spring:
///
/// ```
/// use prehend_autodiff::Scalar;
/// use prehend_sim::{Contact, Isotropic, IsotropicLaw};
///
/// struct Exponential;
///
/// impl IsotropicLaw for Exponential {
///     fn normal_force<S: Scalar>(&self, _: &[S], contact: &Contact<S>) -> S {
///         (-contact.gap.times(1e3)).exp_m1().times(1e4 * contact.area)
///     }
///     fn friction_coefficient<S: Scalar>(&self, _: &[S], _: S) -> S {
///         S::constant(0.5)
///     }
///     fn slip_scale(&self) -> f64 {
///         1e-3
///     }
/// }
///
/// let stick_slip = Isotropic(Exponential).with_stribeck(0.3, 1e-2)?;
/// # Ok::<(), prehend_sim::LawError>(())
/// ```
pub trait IsotropicLaw: Send + Sync {
    /// Parameters that may carry derivatives.
    fn params(&self) -> &[f64] {
        &[]
    }

    /// Normal force \[N\], never negative.
    fn normal_force<S: Scalar>(&self, p: &[S], contact: &Contact<S>) -> S;

    /// Friction coefficient at a (regularized) slip speed \[m/s\].
    fn friction_coefficient<S: Scalar>(&self, p: &[S], slip_speed: S) -> S;

    /// Slip speed v_s at which friction has reached 1/√2 of its bound \[m/s\], positive.
    fn slip_scale(&self) -> f64;

    /// Beyond this gap both value and derivative are zero \[m\].
    fn reach(&self) -> f64 {
        0.0
    }

    /// See [`ContactLaw::check`].
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    fn check(&self, _p: &[f64]) -> Result<(), LawError> {
        Ok(())
    }
}

/// Adapter from an [`IsotropicLaw`] to a [`ContactLaw`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Isotropic<L>(
    /// The isotropic law.
    pub L,
);

impl<L: IsotropicLaw> ContactLaw for Isotropic<L> {
    #[inline]
    fn params(&self) -> &[f64] {
        self.0.params()
    }

    #[inline]
    fn law<S: Scalar>(&self, p: &[S], contact: &Contact<S>) -> Response<S> {
        let normal = self.0.normal_force(p, contact);
        let speed = regularized_speed(&contact.slip, self.0.slip_scale());
        let coefficient = self.0.friction_coefficient(p, speed);
        let tangential =
            regularized_coulomb(coefficient, normal, &contact.slip, self.0.slip_scale());
        Response { normal, tangential }
    }

    #[inline]
    fn reach(&self) -> f64 {
        self.0.reach()
    }

    fn check(&self, p: &[f64]) -> Result<(), LawError> {
        self.0.check(p)
    }
}

mod sealed {
    pub trait Sealed {}
    impl<L: super::ContactLaw> Sealed for L {}
}

/// The object-safe twin of [`ContactLaw`], implemented for every law: forces at a contact and over all contacts of a
/// surface, and their derivatives by forward mode. Loops over contacts are inside, where the law is known.
pub trait LocalLaw: Send + Sync + sealed::Sealed {
    /// See [`ContactLaw::params`].
    fn parameters(&self) -> &[f64];

    /// See [`ContactLaw::reach`] \[m\].
    fn cutoff(&self) -> f64;

    /// See [`ContactLaw::check`].
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    fn check_parameters(&self, p: &[f64]) -> Result<(), LawError>;

    /// Force at one contact, with parameters `p`.
    fn response(&self, p: &[f64], contact: &Contact<f64>) -> Response<f64>;

    /// Force at one contact with its derivatives along the directions that `contact` and `p` carry.
    fn response_with_derivative(&self, p: &[Fwd<6>], contact: &Contact<Fwd<6>>)
    -> Response<Fwd<6>>;

    /// Force \[N\], then torque about the center of mass \[N m\], of all contacts of `patch`, in the field's frame.
    fn wrench(&self, p: &[f64], patch: &Patch<'_>) -> Vector6<f64>;

    /// [`LocalLaw::wrench`] with its derivatives by the state, and by the parameters if `by_params`.
    fn wrench_jacobian(&self, p: &[f64], patch: &Patch<'_>, by_params: bool) -> WrenchJacobian;
}

impl<L: ContactLaw> LocalLaw for L {
    #[inline]
    fn parameters(&self) -> &[f64] {
        self.params()
    }

    #[inline]
    fn cutoff(&self) -> f64 {
        self.reach()
    }

    fn check_parameters(&self, p: &[f64]) -> Result<(), LawError> {
        self.check(p)
    }

    #[inline]
    fn response(&self, p: &[f64], contact: &Contact<f64>) -> Response<f64> {
        self.law(p, contact)
    }

    #[inline]
    fn response_with_derivative(
        &self,
        p: &[Fwd<6>],
        contact: &Contact<Fwd<6>>,
    ) -> Response<Fwd<6>> {
        self.law(p, contact)
    }

    fn wrench(&self, p: &[f64], patch: &Patch<'_>) -> Vector6<f64> {
        wrench::wrench(self, p, patch)
    }

    fn wrench_jacobian(&self, p: &[f64], patch: &Patch<'_>, by_params: bool) -> WrenchJacobian {
        wrench::wrench_jacobian(self, p, patch, by_params)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Penalty;

    #[test]
    fn the_object_safe_twin_gives_the_laws_own_derivatives() {
        let law = Penalty::new(3e7, 2e5, 0.7, 1e-2).unwrap();
        let boxed: Box<dyn LocalLaw> = Box::new(law);
        let [gap, normal_speed, x, y, z, k] = Fwd::variables([-1e-3, -0.1, 0.02, 0.01, 0.0, 3e7]);
        let normal = Vector3::z().map(Fwd::constant);
        let contact =
            Contact { gap, normal_speed, slip: Vector3::new(x, y, z), normal, area: 2e-5 };
        let p = [k, Fwd::constant(2e5), Fwd::constant(0.7)];
        let (own, twin) = (law.law(&p, &contact), boxed.response_with_derivative(&p, &contact));
        assert_eq!(own.normal.derivative, twin.normal.derivative);
        assert_eq!(own.tangential.x.derivative, twin.tangential.x.derivative);
        assert_eq!((boxed.parameters(), boxed.cutoff()), (law.params(), law.reach()));
    }
}
