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
//! and rigid motions, [`check`] the finite differences that every derivative here is held against.

mod chain;
pub mod check;
mod fwd;
pub mod lie;
mod real_field;
mod scalar;
mod stumpff;
mod tape;
mod var;
mod vjp;

pub use fwd::Fwd;
pub use scalar::Scalar;
pub use tape::{Adjoints, Recording, gradient};
pub use var::Var;
pub use vjp::{CustomVjp, block, custom};
