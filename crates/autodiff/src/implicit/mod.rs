//! Solutions of equations as differentiable functions of their parameters.
//!
//! If F(x, p) = 0 then J dx = −F_p dp with J = ∂F/∂x: the derivative of a solution needs the equation,
//! not the solver that found x. Adjoints are Jᵀ λ = x̄, p̄ −= F_pᵀ λ (A. Griewank, A. Walther, "Evaluating
//! derivatives", 2nd ed. 2008, chapter 15).
//!
//! # A differentiable solve
//! One step of implicit Euler of a hardening spring, far stiffer than an explicit step would bear:
//!
//! ```
//! use prehend_autodiff::implicit::{ImplicitError, Residual, newton, solution};
//! use prehend_autodiff::{Operand, Scalar, check, gradient};
//!
//! /// m (v′ − v) + h f(q + h v′) = 0 for the new speed v′, with f = k (q + 100 q³).
//! #[derive(Clone)]
//! struct Step { mass: f64, h: f64 }
//!
//! impl Residual for Step {
//!     fn residual<S: Scalar>(&self, x: &[S], p: &[S]) -> Vec<S> {
//!         let [m, h] = [self.mass, self.h].map(S::constant);
//!         let [stiffness, position, speed] = [p[0], p[1], p[2]];
//!         let q = position + h * x[0];
//!         vec![m * (x[0] - speed) + h * stiffness * (q + S::constant(100.0) * q * q * q)]
//!     }
//! }
//!
//! fn new_speed<S: Operand>(step: &Step, p: &[S]) -> Result<S, ImplicitError> {
//!     let values: Vec<f64> = p.iter().map(|p| p.value()).collect();
//!     let x = newton(step, &[0.0], &values)?;
//!     Ok(solution(step.clone(), &x, p)?[0])
//! }
//!
//! let (step, p) = (Step { mass: 0.1, h: 0.01 }, [1e6, 0.02, -1.0]);
//! let (_, exact) = gradient(|p| new_speed(&step, p).unwrap(), &p);
//! let differences = check::finite_difference_gradient(|p| new_speed(&step, p).unwrap(), &p, 1e-3);
//! assert!(check::compare_gradients(&exact, &differences).relative < 1e-6);
//! # Ok::<(), ImplicitError>(())
//! ```

mod error;
mod linearization;
mod newton;
mod residual;
mod solution;

pub use error::ImplicitError;
pub use newton::{Equations, newton, newton_on};
pub use residual::Residual;
pub use solution::{solution, solution_with};
