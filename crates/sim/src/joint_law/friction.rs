//! Dry friction.

use prehend_autodiff::Scalar;

use super::JointLaw;
use crate::contact::parameters::law_part;

law_part! {
    /// Dry friction, regularized as that of contacts is: τ = −f q̇ / √(q̇² + s²). What it holds creeps at a part of s.
    pub struct JointFriction: "dry friction" {
        friction ["N m or N"] NotNegative "effort in fast motion";
    }
    constants {
        velocity_scale ["rad/s or m/s"] Positive "velocity s at which it has 1/√2 of that";
    }
}

impl JointLaw for JointFriction {
    #[inline]
    fn effort<S: Scalar>(&self, [friction]: [S; 1], _: S, velocity: S) -> S {
        let square = velocity * velocity + S::constant(self.velocity_scale.powi(2));
        -friction * velocity / square.sqrt()
    }

    fn is_passive(&self) -> bool {
        true
    }
}
