//! Rotations and rigid motions as exponentials, exact in value and derivatives at zero and everywhere else.
//!
//! nalgebra's own `from_scaled_axis` branches on the norm and loses the derivative at zero; these use
//! power series there. Twists are ordered (translation ρ \[m\], rotation ω \[rad\]), and so are the rows
//! and columns of 6×6 matrices. Formulas: J. Solà, J. Deray, D. Atchuthan, "A micro Lie theory for state
//! estimation in robotics", 2018, appendices B and D.
//!
//! | | SO(3) | SE(3) |
//! |---|---|---|
//! | exponential, logarithm | [`so3_exp`], [`so3_log`] | [`se3_exp`], [`se3_log`] |
//! | left Jacobian, inverse | [`so3_left_jacobian`], [`so3_left_jacobian_inverse`] | [`se3_left_jacobian`] |
//! | right Jacobian, inverse | [`so3_right_jacobian`], [`so3_right_jacobian_inverse`] | |
//! | adjoint of the group | the rotation matrix itself | [`se3_adjoint`] |
//! | adjoint of the algebra | [`cross_matrix`] | |
//!
//! [`lift`] makes constants of a pose. [`twist_row`] is the derivative of a point's coordinate by a left twist about a center, [`perturb_about`] that twist.
//!
//! All are finite, with their first and second derivatives, for twists of entries up to 10⁶⁰ (products of several must be in range), inverse Jacobians
//! except at whole turns.
//!
//! A right Jacobian moves the perturbation to the other side: exp(ξ + δ) ≈ exp(ξ) exp(J_r δ). It is the
//! left one of −ξ.

mod se3;
mod so3;

pub use se3::{lift, perturb_about, se3_adjoint, se3_exp, se3_left_jacobian, se3_log, twist_row};
pub use so3::{
    cross_matrix, so3_exp, so3_left_jacobian, so3_left_jacobian_inverse, so3_log,
    so3_right_jacobian, so3_right_jacobian_inverse,
};
