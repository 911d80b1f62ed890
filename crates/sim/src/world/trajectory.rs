//! Trajectories of driven bodies.

use std::any::Any;
use std::sync::Arc;

use prehend_autodiff::Scalar;

use super::World;
use super::body::Motion;
use crate::error::SimulationError;
use crate::state::State;

/// State of a model frame in the world as a function of time: a function from seconds to a [`State`], for instance.
///
/// Over numbers that carry derivatives, those of what drives the body, a speed or a waypoint, go into the simulation.
/// The velocities must have theirs, too: they are the rates at which the pose changes.
pub trait Trajectory<S: Scalar = f64>: Any + Send + Sync {
    /// The state at `time` \[s\].
    fn state(&self, time: f64) -> State<S>;
}

impl<S: Scalar, F: Fn(f64) -> State<S> + Send + Sync + 'static> Trajectory<S> for F {
    fn state(&self, time: f64) -> State<S> {
        self(time)
    }
}

/// A plain trajectory in constants of another scalar.
struct Lifted(Arc<dyn Trajectory>);

impl<S: Scalar> Trajectory<S> for Lifted {
    fn state(&self, time: f64) -> State<S> {
        self.0.state(time).lift()
    }
}

/// The plain trajectory that `trajectory` is, or is made of; none if it may carry derivatives.
pub(crate) fn plain<S: Scalar>(trajectory: &Arc<dyn Trajectory<S>>) -> Option<Arc<dyn Trajectory>> {
    let inner: &dyn Any = trajectory.as_ref();
    let lifted = inner.downcast_ref().map(|Lifted(plain)| plain);
    lifted.or_else(|| (trajectory as &dyn Any).downcast_ref()).cloned()
}

/// The values of `trajectory` in constants of another scalar.
pub(super) fn constant<S: Scalar, T: Scalar>(
    trajectory: &Arc<dyn Trajectory<S>>,
) -> Arc<dyn Trajectory<T>> {
    let values = || -> Arc<dyn Trajectory> {
        let trajectory = Arc::clone(trajectory);
        Arc::new(move |time: f64| trajectory.state(time).value())
    };
    Arc::new(Lifted(plain(trajectory).unwrap_or_else(values)))
}

impl<S: Scalar> World<S> {
    /// Refuses trajectories that may carry derivatives, for what keeps their values only.
    pub(crate) fn check_trajectories(&self) -> Result<(), SimulationError> {
        let carries = |motion: &Motion<S>| matches!(motion, Motion::Driven(trajectory) if plain(trajectory).is_none());
        match self.bodies.iter().find(|body| S::ORDER > 0 && carries(&body.motion)) {
            Some(body) => Err(SimulationError::TrajectoryDerivatives { body: body.name.clone() }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector3};
    use prehend_autodiff::Fwd;

    use super::*;
    use crate::Body;

    #[test]
    fn a_lifted_trajectory_is_known_again_and_values_of_one_with_derivatives_are_found() {
        let mut world = World::new(Vector3::zeros());
        let still = |_: f64| State::at_rest(Isometry3::identity());
        world.add(Body::driven("table", still));
        let source = |motion: &Motion| match motion {
            Motion::Driven(trajectory) => plain(trajectory).unwrap(),
            _ => panic!("not driven"),
        };
        let there_and_back = world.lift::<Fwd<1>>().plain().lift::<Fwd<2>>().plain();
        let [a, b] = [&world, &there_and_back].map(|world| source(&world.bodies[0].motion));
        assert!(Arc::ptr_eq(&a, &b));

        let mut lifted = world.lift::<Fwd<1>>();
        assert_eq!(lifted.check_trajectories(), Ok(()));
        let [speed] = Fwd::<1>::variables([0.2]);
        lifted.bodies[0].motion = Motion::Driven(Arc::new(move |time: f64| {
            let mut state = State::at_rest(Isometry3::identity());
            state.pose.translation.x = speed.times(time);
            state
        }));
        let error = SimulationError::TrajectoryDerivatives { body: "table".to_owned() };
        assert_eq!(lifted.check_trajectories(), Err(error.clone()));
        assert_eq!(lifted.with_parameters(&lifted.parameters()).unwrap_err(), error);
        let mut state = [State::at_rest(Isometry3::identity())];
        lifted.plain().drive(&mut state, 0.5);
        assert_eq!(state[0].pose.translation.x, 0.1);
    }
}
