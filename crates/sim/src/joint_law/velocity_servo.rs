//! A servo that keeps a velocity.

use prehend_autodiff::Scalar;

use super::{JointLaw, saturated};
use crate::contact::parameters::law_part;

law_part! {
    /// A servo that keeps a velocity, with a limited effort: τ = c (q̇* − q̇).
    pub struct VelocityServo: "velocity servo" {
        target ["rad/s or m/s"] Finite "velocity to keep";
        damping ["N m s/rad or N s/m"] NotNegative "effort per error";
    }
    constants {
        max_effort ["N m or N"] PositiveOrInfinite "largest effort";
    }
}

impl JointLaw for VelocityServo {
    #[inline]
    fn effort<S: Scalar>(&self, [target, damping]: [S; 2], _: S, velocity: S) -> S {
        saturated(damping * (target - velocity), self.max_effort)
    }
}
