//! The wrench of a contact as a function of how a body moves.

use prehend_autodiff::{LocalFunction, Scalar};

use super::contact_query::ContactQuery;
use super::dynamic::DynContactLaw;
use super::wrench::{LinearWrench, WrenchJacobian};

/// The wrench of `query` as a function of the tangent of its body's state, to first order.
pub(crate) struct WrenchFunction<'a> {
    pub(crate) law: &'a dyn DynContactLaw,
    pub(crate) p: &'a [f64],
    pub(crate) query: &'a ContactQuery<'a>,
}

impl LocalFunction<12, 6> for WrenchFunction<'_> {
    #[inline]
    fn evaluate<S: Scalar>(&self, tangent: [S; 12]) -> [S; 6] {
        let WrenchJacobian { wrench, by_state, .. } =
            self.law.wrench_jacobian(self.p, self.query, false);
        LinearWrench { value: wrench.into(), by_state }.evaluate(tangent)
    }

    #[inline]
    fn derivative_along(&self, _: [f64; 12], tangent: [f64; 12]) -> Option<([f64; 6], [f64; 6])> {
        let [wrench, slope] = self.law.wrench_along(self.p, self.query, &tangent);
        Some((wrench.into(), slope.into()))
    }
}
