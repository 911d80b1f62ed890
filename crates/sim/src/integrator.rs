//! Integrators: schemes that advance states in time.

pub(crate) mod adaptive;
pub(crate) mod backward_euler;
pub(crate) mod model_template;
pub(crate) mod runge_kutta;
pub(crate) mod semi_implicit;
pub(crate) mod step_checkpointed;
pub(crate) mod sub_stepped;

pub use self::adaptive::Adaptive;
pub use self::backward_euler::BackwardEuler;
pub use self::runge_kutta::classic::RungeKutta4;
pub use self::semi_implicit::SemiImplicitEuler;
pub use self::step_checkpointed::StepCheckpointed;
pub use self::sub_stepped::SubStepped;

use prehend_autodiff::Scalar;

use crate::error::Result;
use crate::model::Model;
use crate::state::State;
use crate::time::Step;

/// A time stepping scheme, written once over the scalar: plain numbers simulate, others differentiate.
///
/// ```
/// use nalgebra::Vector3;
/// use prehend_autodiff::Scalar;
/// use prehend_sim::{Integrator, SimulationError, State, Step, Model};
///
/// /// Bodies that fly straight on.
/// struct Drift;
///
/// impl Integrator for Drift {
///     fn step<S: Scalar>(
///         &self,
///         _: &Model<S>,
///         state: &State<S>,
///         step: Step,
///     ) -> Result<State<S>, SimulationError> {
///         let mut next = state.clone();
///         for body in next.bodies_mut() {
///             body.pose.translation.vector += body.linear * S::constant(step.dt);
///         }
///         Ok(next)
///     }
/// }
/// ```
pub trait Integrator: Sync {
    /// State one time step later. Its time is set, and bodies that forces do not move are moved, after every step.
    ///
    /// # Errors
    /// If the scheme solves equations and they were not solved.
    fn step<S: Scalar>(&self, model: &Model<S>, state: &State<S>, step: Step) -> Result<State<S>>;

    /// The largest dt·max(ω, c) at which linear contacts of angular frequency ω and damping rate c
    /// ([`Model::contact_frequency`]) are stable, whatever the smaller of the two; infinite for a scheme that is stable always.
    ///
    /// The default suits semi-implicit and higher-order explicit schemes (explicit Euler has no such limit: it is unstable).
    fn stability_limit(&self) -> f64 {
        1.0
    }

    /// True if a step evaluates forces once, at its start. Then samples that are out of reach there may be left out.
    fn evaluates_forces_once(&self) -> bool {
        false
    }

    /// True if it looks for the contacts of [`Model::contact_groups`] itself. Others are given a model in which those that may
    /// touch within the step are [`contacts`](Model::contacts).
    fn finds_contacts(&self) -> bool {
        false
    }

    /// Checks that derivatives of its steps in `model` are those of the motion. What takes steps by values first asks here.
    ///
    /// # Errors
    /// If they are not.
    fn check_differentiable<S: Scalar>(&self, _world: &Model<S>) -> Result<()> {
        Ok(())
    }

    /// True if the scheme holds its error itself, whatever the step.
    fn controls_error(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Still;

    impl Integrator for Still {
        fn step<S: Scalar>(&self, _: &Model<S>, state: &State<S>, _: Step) -> Result<State<S>> {
            Ok(state.clone())
        }
    }

    #[test]
    fn a_scheme_that_says_nothing_is_explicit_and_promises_nothing() {
        assert_eq!(Still.stability_limit(), 1.0);
        assert!(!Still.evaluates_forces_once() && !Still.finds_contacts());
        assert!(!Still.controls_error());
    }
}
