//! A motor.

use prehend_autodiff::Scalar;

use super::JointLaw;
use crate::contact::parameters::law_part;

law_part! {
    /// An effort, whatever the motion: what a controller sets.
    pub struct Motor: "motor" {
        effort ["N m or N"] Finite "effort";
    }
}

impl JointLaw for Motor {
    #[inline]
    fn effort<S: Scalar>(&self, [effort]: [S; 1], _: S, _: S) -> S {
        effort
    }
}
