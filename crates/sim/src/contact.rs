//! Penalty contact between surface samples of a body and a signed distance field: laws and their parts.

pub(crate) mod bristle_function;
pub(crate) mod bristle_law;
pub(crate) mod bristles;
pub(crate) mod calibration;
pub(crate) mod composite;
pub(crate) mod contact_query;
pub(crate) mod dynamic;
pub(crate) mod error;
pub(crate) mod force_jump;
pub(crate) mod friction;
pub(crate) mod gap_smoothing;
pub(crate) mod graspd;
pub(crate) mod law;
#[cfg(test)]
pub(crate) mod law_checks;
pub(crate) mod moved;
pub(crate) mod normal;
pub(crate) mod parameters;
pub(crate) mod point;
pub(crate) mod range;
pub(crate) mod registry;
pub mod restitution;
pub(crate) mod wrench;

pub use self::bristles::Bristles;
pub use self::calibration::ContactCalibration;
pub use self::composite::Law;
pub use self::dynamic::DynContactLaw;
pub use self::error::LawError;
pub use self::friction::anisotropic::AnisotropicFriction;
pub use self::friction::bristle::BristleFriction;
pub use self::friction::coulomb::Coulomb;
pub use self::friction::stribeck::Stribeck;
pub use self::friction::{FrictionCoefficient, FrictionLaw, regularized_coulomb};
pub use self::gap_smoothing::{GapSmoothing, LeakSteps};
pub use self::graspd::{GraspD, GraspDParameters};
pub use self::law::ContactLaw;
pub use self::normal::NormalLaw;
pub use self::normal::approach_damped::ApproachDamped;
pub use self::normal::hertz::Hertz;
pub use self::normal::hunt_crossley::{Bounce, HuntCrossley};
pub use self::normal::kelvin_voigt::KelvinVoigt;
pub use self::parameters::{LawParameter, ParameterArray, Parameters};
pub use self::point::{ContactForce, ContactKinematics};
pub use self::range::ParameterRange;
pub use self::registry::{LawConstructor, LawEntry, LawRegistry};
