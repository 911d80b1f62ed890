//! Articulated bodies in reduced coordinates.
//!
//! An [`Articulation`] is a tree of links; [`Articulation::kinematics`] says where they are and how they move, from which come
//!
//! | | function | algorithm |
//! |---|---|---|
//! | τ of q, v and v̇ | [`Kinematics::inverse_dynamics`] | recursive Newton–Euler |
//! | v̇ of q, v and τ | [`Kinematics::forward_dynamics`] | articulated body |
//! | M of q | [`Kinematics::mass_matrix`] | composite rigid body |
//! | ∂τ by q and v | [`Kinematics::inverse_dynamics_derivatives`] | Singh, Russell and Wensing, 2022 |
//! | kinetic and potential energy | [`Kinematics::energy`] | |
//! | ∂ of a link's velocity by v | [`Kinematics::jacobian`] | |
//!
//! All but derivatives are generic over the scalar, to first derivatives. Algorithms are those of Featherstone, Rigid Body Dynamics Algorithms, 2008, in one frame for all
//! links, whose axes are the world's: nothing has to be brought from link to link.

pub(crate) mod adjoint;
mod derivatives;
mod forward_dynamics;
mod inverse_dynamics;
mod joint;
mod joint_model;
pub(crate) mod joint_state;
mod kinematics;
pub(crate) mod link;
mod mass_matrix;
#[cfg(test)]
mod tests;
pub(crate) mod tree_factor;

pub use self::derivatives::{DynamicsDerivatives, ForwardDerivatives};
pub use self::joint::{CustomJoint, Joint};
pub use self::joint_model::JointModel;
pub use self::joint_state::JointState;
pub use self::kinematics::{Energy, Kinematics};
pub use self::link::{Articulation, ArticulationError, Link};
