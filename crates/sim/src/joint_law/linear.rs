//! Laws that are linear in position and velocity: springs, dampers, motors and servos.

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

/// `effort`, but no more than `most` either way.
#[inline]
fn saturated<S: Scalar>(effort: S, most: f64) -> S {
    if effort.value().abs() > most { S::constant(most.copysign(effort.value())) } else { effort }
}
