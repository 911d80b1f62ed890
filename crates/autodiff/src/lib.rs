//! Automatic differentiation of ordinary nalgebra code, for simulation.
//!
//! # A first gradient
//! Write a function once over [`Scalar`]; run it with `f64`, with forward mode [`Fwd`] for few inputs or
//! with reverse mode [`Var`] for many, inside every nalgebra type:
//!
//! ```
//! use prehend_autodiff::{Fwd, Scalar, gradient};
//!
//! fn energy<S: Scalar>(x: &[S]) -> S {
//!     x[0] * x[0] * S::constant(0.5) + x[1].sin()
//! }
//!
//! let x = [2.0, 0.0];
//! let (value, reverse) = gradient(energy, &x);
//! let forward = energy(&Fwd::<2>::variables(x));
//! assert_eq!((value, reverse), (forward.value, forward.derivative.to_vec()));
//! ```
//!
//! Forward mode needs no memory and wins up to some 16 inputs on plain code. Reverse mode costs a few
//! evaluations whatever the number of inputs; what makes it fast is to record little: see [below](#a-derivative-of-your-own).
//!
//! | wanted | use |
//! |---|---|
//! | gradient | [`gradient`], [`gradient_into`] (allocates nothing), [`Recording`] for control |
//! | Jacobian | [`jacobian`], [`forward_jacobian`] |
//! | Hessian, Hessian–vector product | `Fwd<N, Fwd<N>>`, `Fwd<1, Var>` |
//! | gradient through thousands of steps | [`Scalar::recompute`]: one node a step |
//! | derivative of a linear solve, of a root | [`solve`], [`implicit`] |
//! | an operation with its own derivative | [`LocalFunction`], [`CustomVjp`]: see [below](#a-derivative-of-your-own) |
//! | rotations and rigid motions | [`lie`], [`rigid`] |
//! | something to minimize with | [`optimize`] |
//! | an independent derivative to test against | [`check`] |
//!
//! # A derivative of your own
//!
//! | the operation | implement | apply with |
//! |---|---|---|
//! | takes a fixed, small number of scalars | [`LocalFunction`] | [`Scalar::local`] |
//! | takes many numbers and knows its vector–Jacobian product: an image, a point set | [`CustomVjp`] | [`custom`] |
//! | is generic code, too long to keep on the tape: a time step | [`Recompute`] | [`Scalar::recompute`] |
//!
//! A [`LocalFunction`] is the default: generic code that may bring its Jacobian. Reverse mode records it as one
//! block, without what is inside. Here a contact force and its slope, with the slope left to forward mode:
//!
//! ```
//! use prehend_autodiff::{LocalFunction, Scalar, gradient};
//!
//! struct Contact { stiffness: f64 }
//!
//! impl LocalFunction<2, 1> for Contact {
//!     fn evaluate<S: Scalar>(&self, [depth, speed]: [S; 2]) -> [S; 1] {
//!         let force = depth * depth.sqrt() * (S::one() - speed.times(0.5));
//!         [force.times(self.stiffness).select(depth.value() > 0.0, S::zero())]
//!     }
//! }
//!
//! let contact = Contact { stiffness: 1e4 };
//! let (force, by) = gradient(|x| Scalar::local(&contact, [x[0], x[1]])[0], &[0.01, -1.0]);
//! assert!((by[0] - 1.5 * force / 0.01).abs() < 1e-9 * by[0]);
//! ```
//!
//! # Further
//! [A differentiable solve](implicit#a-differentiable-solve).
//!
//! A [`Var`] belongs to its [`Recording`] and thread: using it elsewhere is a panic that says so, never a wrong
//! number. At singular points the derivative is documented (in [`Scalar`] and at each function), and a
//! branch that is not taken contributes nothing, not even a NaN.

#![cfg_attr(docsrs, feature(doc_cfg))]

mod arena;
mod arithmetic;
pub mod check;
mod differentiable;
mod fwd;
pub mod implicit;
mod jacobian;
mod lanes;
pub mod lie;
pub mod optimize;
mod quadratic;
mod real_field;
mod recomputed;
mod record;
mod recording;
mod reverse;
pub mod rigid;
mod scalar;
pub mod solve;
mod stumpff;
mod sweep;
mod tape;
mod var;
mod vjp;

pub use fwd::Fwd;
pub use jacobian::{forward_jacobian, jacobian};
pub use quadratic::Quadratic;
pub use record::custom;
pub use recording::{Adjoints, Recording, gradient, gradient_into};
pub use scalar::{LocalFunction, Recompute, Scalar};
pub use tape::TapeStatistics;
pub use var::Var;
pub use vjp::CustomVjp;
