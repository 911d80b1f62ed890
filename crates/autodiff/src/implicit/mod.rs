//! Roots of equations as differentiable functions of their parameters.
//!
//! [`newton`] finds x of F(x, p) = 0. Its derivative needs the equation, not the iteration: x − J⁻¹ F(x, p) with J = ∂F/∂x
//! ([`solve`](crate::solve#matrices-with-derivatives)).
//!
//! # A differentiable solve
//! One step of implicit Euler of a hardening spring, far stiffer than an explicit step would bear:
//!
//! ```
//! use nalgebra::{DVector, Vector1};
//! use prehend_autodiff::implicit::{Equations, ImplicitError, newton};
//! use prehend_autodiff::solve::{Factored, lu};
//! use prehend_autodiff::{Fwd, Scalar, check, gradient};
//!
//! /// m (v′ − v) + h f(q + h v′) = 0 for the new speed v′, with f = k (q + 100 q³).
//! struct Step<S> { mass: f64, h: f64, stiffness: S, position: S, speed: S }
//!
//! impl<S: Scalar> Step<S> {
//!     fn excess(&self, v: S) -> S {
//!         let q = self.position + v.times(self.h);
//!         let force = self.stiffness * (q + q.powi(3).times(100.0));
//!         (v - self.speed).times(self.mass) + force.times(self.h)
//!     }
//!
//!     fn map<T>(&self, f: impl Fn(S) -> T) -> Step<T> {
//!         let [stiffness, position, speed] = [self.stiffness, self.position, self.speed].map(f);
//!         Step { mass: self.mass, h: self.h, stiffness, position, speed }
//!     }
//! }
//!
//! impl Equations for Step<f64> {
//!     fn residual(&self, x: &DVector<f64>) -> DVector<f64> {
//!         x.map(|v| self.excess(v))
//!     }
//!     fn linearize(&self, x: &DVector<f64>) -> Result<(DVector<f64>, Factored), ImplicitError> {
//!         let Fwd { value, derivative: [slope] } = self.map(Fwd::constant).excess(Fwd::variable(x[0], 0));
//!         Ok((DVector::from_element(1, value), lu(&Vector1::new(slope))?))
//!     }
//! }
//!
//! fn new_speed<S: Scalar>(p: &[S]) -> Result<S, ImplicitError> {
//!     let step = Step { mass: 0.1, h: 0.01, stiffness: p[0], position: p[1], speed: p[2] };
//!     let values = step.map(S::value);
//!     let x = newton(&values, DVector::zeros(1))?;
//!     let (_, jacobian) = values.linearize(&x)?;
//!     let v = S::constant(x[0]);
//!     Ok(v - S::solve(&jacobian, &[step.excess(v)])[0])
//! }
//!
//! let p = [1e6, 0.02, -1.0];
//! let (_, exact) = gradient(|p| new_speed(p).unwrap(), &p);
//! let differences = check::finite_difference_gradient(|p| new_speed(p).unwrap(), &p, 1e-3);
//! assert!(check::compare_gradients(&exact, &differences).relative < 1e-6);
//! # Ok::<(), ImplicitError>(())
//! ```

mod error;
mod newton;

pub use error::ImplicitError;
pub use newton::{Equations, newton};
