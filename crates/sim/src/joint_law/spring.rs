//! A spring.

use prehend_autodiff::Scalar;

use super::JointLaw;
use crate::contact::parameters::law_part;

law_part! {
    /// A linear spring: τ = −k (q − q₀).
    pub struct JointSpring: "spring" {
        stiffness ["N m/rad or N/m"] NotNegative "effort per deflection";
        rest ["rad or m"] Finite "position at which it pulls nowhere";
    }
}

impl JointLaw for JointSpring {
    #[inline]
    fn effort<S: Scalar>(&self, [stiffness, rest]: [S; 2], position: S, _: S) -> S {
        stiffness * (rest - position)
    }

    fn is_passive(&self) -> bool {
        true
    }
}
