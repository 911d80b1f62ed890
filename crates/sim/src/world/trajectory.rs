//! Trajectories of driven bodies.

use std::any::Any;
use std::sync::Arc;

use prehend_autodiff::Scalar;

use crate::state::State;

/// State of a model frame in the world as a function of time: a function from seconds to a [`State`], for instance.
///
/// The velocities are the rates at which the pose changes, world frame: what touches the body feels them. A rollout in which they
/// are far from that is refused ([`SimulationError::TrajectoryVelocity`]). Kinks and jumps are allowed, and a pose that stays where it is
/// may have any velocity, as a belt has.
///
/// [`World::simulate`] looks at it every millisecond at least: what it does and undoes in less may be missed. Steps of one's own
/// choice look as often as they evaluate forces.
///
/// Over numbers that carry derivatives, those of what drives the body, a speed or a waypoint, go into the simulation.
/// The velocities must have theirs, too.
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
