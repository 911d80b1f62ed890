//! The wrench of a contact as a function of how a body moves.

use prehend_autodiff::{LocalFunction, Scalar};

use super::dynamic::DynContactLaw;
use super::patch::Patch;
use super::wrench::{LinearWrench, WrenchJacobian};

/// The wrench of `patch` as a function of the tangent of its body's state, to first order.
pub(crate) struct WrenchFunction<'a> {
    pub(crate) law: &'a dyn DynContactLaw,
    pub(crate) p: &'a [f64],
    pub(crate) patch: &'a Patch<'a>,
}

impl LocalFunction<12, 6> for WrenchFunction<'_> {
    #[inline]
    fn evaluate<S: Scalar>(&self, tangent: [S; 12]) -> [S; 6] {
        let WrenchJacobian { wrench, by_state, .. } =
            self.law.wrench_jacobian(self.p, self.patch, false);
        LinearWrench { value: wrench.into(), by_state }.evaluate(tangent)
    }

    #[inline]
    fn derivative_along(&self, _: [f64; 12], tangent: [f64; 12]) -> Option<([f64; 6], [f64; 6])> {
        let [wrench, slope] = self.law.wrench_along(self.p, self.patch, &tangent);
        Some((wrench.into(), slope.into()))
    }
}
