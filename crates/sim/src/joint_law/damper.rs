//! A damper.

use prehend_autodiff::Scalar;

use super::JointLaw;
use crate::contact::parameters::law_part;

law_part! {
    /// A linear damper: τ = −c q̇.
    pub struct JointDamper: "damper" {
        damping ["N m s/rad or N s/m"] NotNegative "effort per velocity";
    }
}

impl JointLaw for JointDamper {
    #[inline]
    fn effort<S: Scalar>(&self, [damping]: [S; 1], _: S, velocity: S) -> S {
        -damping * velocity
    }

    fn is_passive(&self) -> bool {
        true
    }
}
