//! Trajectories of kinematic bodies.

use std::any::Any;
use std::sync::Arc;

use prehend_autodiff::Scalar;

use crate::body_state::BodyState;

/// State of a body frame in the model as a function of time: a function from seconds to a [`BodyState`], for instance.
///
/// The velocities are the rates at which the pose changes, world frame: what touches the body feels them. A rollout in which they
/// are far from that is refused ([`SimulationError::TrajectoryVelocity`](crate::SimulationError::TrajectoryVelocity)). Kinks and jumps are allowed, and a pose that stays where it is
/// may have any velocity, as a belt has.
///
/// [`Model::simulate`](crate::Model::simulate) looks at it every millisecond at least: what it does and undoes in less may be missed. Steps of one's own
/// choice look as often as they evaluate forces.
///
/// Over numbers that carry derivatives, those of what drives the body, a speed or a waypoint, go into the simulation.
/// The velocities must have theirs, too.
pub trait Trajectory<S: Scalar = f64>: Any + Send + Sync {
    /// The state at `time` \[s\].
    fn state(&self, time: f64) -> BodyState<S>;
}

impl<S: Scalar, F: Fn(f64) -> BodyState<S> + Send + Sync + 'static> Trajectory<S> for F {
    fn state(&self, time: f64) -> BodyState<S> {
        self(time)
    }
}

/// A plain trajectory in constants of another scalar.
struct Lifted(Arc<dyn Trajectory>);

impl<S: Scalar> Trajectory<S> for Lifted {
    fn state(&self, time: f64) -> BodyState<S> {
        self.0.state(time).cast()
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

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector3};
    use prehend_autodiff::Fwd;

    use super::*;
    use crate::{Body, Model, Motion};

    #[test]
    fn a_lifted_trajectory_is_known_again() {
        let mut model = Model::new(Vector3::zeros());
        model.add(Body::kinematic("table", |_: f64| BodyState::at_rest(Isometry3::identity())));
        let source = |motion: &Motion| match motion {
            Motion::Kinematic(trajectory) => plain(trajectory).unwrap(),
            _ => panic!("not driven"),
        };
        let there_and_back = model.cast::<Fwd<1>>().to_f64().cast::<Fwd<2>>().to_f64();
        let [a, b] = [&model, &there_and_back].map(|model| source(&model.bodies[0].motion));
        assert!(Arc::ptr_eq(&a, &b));
    }

    #[test]
    fn values_of_a_trajectory_with_derivatives_are_found() {
        let mut model = Model::new(Vector3::zeros()).cast::<Fwd<1>>();
        let [speed] = Fwd::<1>::variables([0.2]);
        model.bodies.push(Body::kinematic("table", move |time: f64| {
            let mut state = BodyState::at_rest(Isometry3::identity()).cast();
            state.pose.translation.x = speed.times(time);
            state
        }));
        let model = model.to_f64();
        let mut state = model.neutral_state();
        state.time = 0.5;
        model.update_kinematics(&mut state);
        assert_eq!(state[0].pose.translation.x, 0.1);
    }
}
