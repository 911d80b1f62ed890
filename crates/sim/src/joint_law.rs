//! Laws along a joint: springs, dampers, friction, limits, motors and servos.

pub(crate) mod affine_actuator;
pub(crate) mod dynamic;
pub(crate) mod friction;
pub(crate) mod linear;
pub(crate) mod muscle;
pub(crate) mod range;
pub(crate) mod registry;
#[cfg(test)]
mod tests;

pub use self::affine_actuator::AffineActuator;
pub use self::dynamic::DynJointLaw;
pub use self::friction::{JointFriction, PolynomialDamper};
pub use self::linear::{JointDamper, JointSpring, Motor, PositionServo, VelocityServo};
pub use self::muscle::{Muscle, MuscleActivation};
pub use self::range::{JointLimits, PolynomialSpring, SlackSpring};
pub use self::registry::{JointLawEntry, joint_laws};

use prehend_autodiff::Scalar;

use crate::contact::parameters::Parameters;

/// The effort along a joint, or along a weighted sum of joints, by its position and velocity: \[N m\] by \[rad\], or \[N\] by \[m\]. One
/// function, generic over the scalar, from which come effort and derivatives.
///
/// ```
/// use prehend_autodiff::Scalar;
/// use prehend_sim::contact::Parameters;
/// use prehend_sim::joint_law::JointLaw;
///
/// /// A spring that hardens with the cube of its deflection.
/// struct Hardening {
///     stiffness: f64,
/// }
///
/// impl Parameters for Hardening {
///     type Params<T: Copy> = [T; 1];
///     fn values(&self) -> [f64; 1] {
///         [self.stiffness]
///     }
///     fn names(&self) -> Vec<&'static str> {
///         vec!["stiffness"]
///     }
/// }
///
/// impl JointLaw for Hardening {
///     fn effort<S: Scalar>(&self, [stiffness]: [S; 1], position: S, _velocity: S) -> S {
///         -stiffness * position.powi(3)
///     }
///     fn is_passive(&self) -> bool {
///         true
///     }
/// }
///
/// assert_eq!(Hardening { stiffness: 2.0 }.effort([2.0], 0.5, 0.0), -0.25);
/// ```
pub trait JointLaw: Parameters + 'static {
    /// The effort \[N m or N\] at a position \[rad or m\] and velocity, with parameters `p`.
    fn effort<S: Scalar>(&self, p: Self::Params<S>, position: S, velocity: S) -> S;

    /// True if it takes energy or stores it, but brings none: a simulation in which all do checks that none appears.
    fn is_passive(&self) -> bool {
        false
    }
}
