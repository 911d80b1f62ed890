//! Losses that are not linear: dry friction, and damping of the third degree.

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

law_part! {
    /// A damper with force −(a v + b v|v| + c v³) by the rate v, as MuJoCo's polynomial dampers are.
    pub struct PolynomialDamper: "damper with a force of the third degree" {
        linear ["N m s/rad or N s/m"] Finite "a";
        quadratic ["N m s²/rad² or N s²/m²"] Finite "b";
        cubic ["N m s³/rad³ or N s³/m³"] Finite "c";
    }
}

impl JointLaw for PolynomialDamper {
    fn effort<S: Scalar>(&self, [a, b, c]: [S; 3], _: S, velocity: S) -> S {
        let size = velocity.abs();
        -(velocity * ((size * c + b) * size + a))
    }
}
