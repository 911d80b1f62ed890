//! Forward- and reverse-mode automatic differentiation over nalgebra's `RealField`.
//!
//! Write a function once over [`Scalar`] and run it with `f64`, forward-mode [`Fwd`] (few inputs) or
//! reverse-mode [`Var`] (many inputs), inside every nalgebra type:
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
//! [`custom`] and [`block`] record operations that bring their own derivative, [`lie`] holds rotations
//! and rigid motions, [`optimise`] a few small optimisers, [`check`] the finite differences that every
//! derivative here is held against.
//! [`solve`] and [`implicit`] differentiate linear solves and the solutions of equations without
//! differentiating the solver: see [a differentiable solve](implicit#a-differentiable-solve).

mod arena;
mod chain;
pub mod check;
pub mod checkpoint;
pub mod diagnose;
mod fwd;
mod hessian;
pub mod implicit;
pub mod lie;
mod local;
mod operand;
pub mod optimise;
pub mod parallel;
mod real_field;
mod recording;
pub mod rigid;
mod scalar;
pub mod solve;
pub mod sparse;
mod stumpff;
mod sweep;
mod tape;
mod var;
mod vjp;

pub use fwd::Fwd;
pub use hessian::{Second, hessian, hessian_vector};
pub use local::{LocalFunction, preaccumulate};
pub use operand::{CustomJvp, Operand};
pub use recording::{Adjoints, Recording, gradient, gradient_into, jacobian};
pub use scalar::Scalar;
pub use tape::TapeStatistics;
pub use var::Var;
pub use vjp::{CustomVjp, block, custom};
