//! How states advance in time.

mod backward_euler;
mod runge_kutta;
mod semi_implicit;
mod sub_stepped;
#[cfg(test)]
mod tests;
mod velocity_verlet;

use prehend_autodiff::Scalar;

pub use backward_euler::BackwardEuler;
pub use runge_kutta::RungeKutta4;
pub use semi_implicit::SemiImplicitEuler;
pub use sub_stepped::SubStepped;
pub use velocity_verlet::VelocityVerlet;

use crate::error::SimulationError;
use crate::state::State;
use crate::world::{Step, World};

/// A time stepping scheme, written once over the scalar: plain numbers simulate, others differentiate.
///
/// ```
/// use nalgebra::Vector3;
/// use prehend_autodiff::Scalar;
/// use prehend_sim::{Integrator, SimulationError, State, Step, World};
///
/// /// Bodies that fly straight on.
/// struct Drift;
///
/// impl Integrator for Drift {
///     fn step<S: Scalar>(
///         &self,
///         _: &World<S>,
///         states: &[State<S>],
///         step: Step,
///     ) -> Result<Vec<State<S>>, SimulationError> {
///         let mut next = states.to_vec();
///         for state in &mut next {
///             state.pose.translation.vector += state.linear * S::constant(step.dt);
///         }
///         Ok(next)
///     }
/// }
/// ```
pub trait Integrator: Sync {
    /// The states of all bodies one time step later. Bodies that forces do not move are left to
    /// [`World::drive`], which follows every step.
    ///
    /// # Errors
    /// If the scheme solves equations and they were not solved.
    fn step<S: Scalar>(
        &self,
        world: &World<S>,
        states: &[State<S>],
        step: Step,
    ) -> Result<Vec<State<S>>, SimulationError>;

    /// The largest dt·max(ω, damping rate) for which linear contacts are stable, where ω and the damping rate are as in
    /// [`World::contact_frequency`]; infinite for a scheme that is stable always.
    ///
    /// The default suits semi-implicit and higher-order explicit schemes (explicit Euler has no such limit: it is unstable).
    fn stability_limit(&self) -> f64 {
        1.0
    }

    /// Whether a step looks at forces at its start alone. Then samples that are out of reach there may be left out.
    fn needs_forces_at_start_only(&self) -> bool {
        false
    }
}
