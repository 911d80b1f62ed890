//! Contact laws behind a pointer.

use nalgebra::Vector6;
use prehend_autodiff::Fwd;

use super::contact_query::ContactQuery;
use super::error::LawError;
use super::law::ContactLaw;
use super::point::{ContactForce, ContactKinematics};
use super::wrench::{self, WrenchJacobian};

/// A [`ContactLaw`] behind a pointer, whatever it is: forces at a contact and wrenches of all, and their derivatives by forward mode.
/// Loops over contacts are inside, where the law is known. Implemented for every law.
pub trait DynContactLaw: ContactLaw {
    /// Force at one contact, with parameters `p`.
    fn force(&self, p: &[f64], contact: &ContactKinematics<f64>) -> ContactForce<f64>;

    /// Force at one contact with its derivatives along the directions that `contact` and `p` carry.
    fn force_with_derivative(
        &self,
        p: &[Fwd<6>],
        contact: &ContactKinematics<Fwd<6>>,
    ) -> ContactForce<Fwd<6>>;

    /// Force \[N\], then torque about the center of mass \[N m\], of all contacts of `query`, in the field's frame.
    fn wrench(&self, p: &[f64], query: &ContactQuery<'_>) -> Vector6<f64>;

    /// [`DynContactLaw::wrench`] with its derivatives by the state, and by the parameters if `by_params`.
    fn wrench_jacobian(
        &self,
        p: &[f64],
        query: &ContactQuery<'_>,
        by_params: bool,
    ) -> WrenchJacobian;

    /// [`DynContactLaw::wrench`] with its derivative along a direction of the state's [`tangent`](crate::BodyState::tangent).
    fn wrench_along(
        &self,
        p: &[f64],
        query: &ContactQuery<'_>,
        tangent: &[f64; 12],
    ) -> [Vector6<f64>; 2];
}

impl dyn DynContactLaw {
    /// Checks parameters `p`, and the bristles if there are any.
    pub(crate) fn check_all(&self, p: &[f64]) -> Result<(), LawError> {
        self.bristles().map_or(Ok(()), |bristles| bristles.check())?;
        self.check(p)
    }
}

impl<L: ContactLaw> DynContactLaw for L {
    #[inline]
    fn force(&self, p: &[f64], contact: &ContactKinematics<f64>) -> ContactForce<f64> {
        self.law(p, contact)
    }

    #[inline]
    fn force_with_derivative(
        &self,
        p: &[Fwd<6>],
        contact: &ContactKinematics<Fwd<6>>,
    ) -> ContactForce<Fwd<6>> {
        self.law(p, contact)
    }

    fn wrench(&self, p: &[f64], query: &ContactQuery<'_>) -> Vector6<f64> {
        wrench::wrench(self, p, query)
    }

    fn wrench_jacobian(
        &self,
        p: &[f64],
        query: &ContactQuery<'_>,
        by_params: bool,
    ) -> WrenchJacobian {
        wrench::wrench_jacobian(self, p, query, by_params)
    }

    fn wrench_along(
        &self,
        p: &[f64],
        query: &ContactQuery<'_>,
        tangent: &[f64; 12],
    ) -> [Vector6<f64>; 2] {
        wrench::wrench_along(self, p, query, tangent)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use prehend_autodiff::Scalar;

    use super::*;
    use crate::scenes::penalty;

    #[test]
    fn a_law_behind_a_pointer_gives_its_own_derivatives() {
        let law = penalty(3e7, 2e5, 0.7, 1e-2);
        let boxed: Box<dyn DynContactLaw> = Box::new(law.clone());
        let [gap, normal_speed, x, y, z, k] = Fwd::variables([-1e-3, -0.1, 0.02, 0.01, 0.0, 3e7]);
        let normal = Vector3::z().map(Fwd::constant);
        let contact = ContactKinematics {
            gap,
            normal_speed,
            slip: Vector3::new(x, y, z),
            normal,
            area: Fwd::constant(2e-5),
        };
        let p = [k, Fwd::constant(2e5), Fwd::constant(0.7)];
        let (own, twin) = (law.law(&p, &contact), boxed.force_with_derivative(&p, &contact));
        assert_eq!(own.normal.derivative, twin.normal.derivative);
        assert_eq!(own.tangential.x.derivative, twin.tangential.x.derivative);
        // With both traits in scope.
        assert_eq!((boxed.params(), boxed.cutoff()), (law.params(), law.cutoff()));
    }
}
