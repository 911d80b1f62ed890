//! A servo that goes to a position.

use prehend_autodiff::Scalar;

use super::{JointLaw, saturated};
use crate::contact::parameters::law_part;

law_part! {
    /// A servo that holds a position, with a limited effort: τ = k (q* − q) − c q̇.
    pub struct PositionServo: "position servo" {
        target ["rad or m"] Finite "position to hold";
        stiffness ["N m/rad or N/m"] NotNegative "effort per error";
        damping ["N m s/rad or N s/m"] NotNegative "effort per velocity";
    }
    constants {
        max_effort ["N m or N"] PositiveOrInfinite "largest effort";
    }
}

impl JointLaw for PositionServo {
    #[inline]
    fn effort<S: Scalar>(&self, p: [S; 3], position: S, velocity: S) -> S {
        let [target, stiffness, damping] = p;
        saturated(stiffness * (target - position) - damping * velocity, self.max_effort)
    }
}
