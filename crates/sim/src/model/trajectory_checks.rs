//! Checks of trajectories.

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

use super::Model;
use super::body::Motion;
use super::trajectory::plain;
use crate::body_state::BodyState;
use crate::error::{BuildError, Result, SimulationError};

impl<S: Scalar> Model<S> {
    /// Refuses trajectories that may carry derivatives, for what keeps their values only.
    pub(crate) fn check_trajectories(&self) -> Result<(), BuildError> {
        let carries = |motion: &Motion<S>| matches!(motion, Motion::Kinematic(trajectory) if plain(trajectory).is_none());
        match self.bodies.iter().find(|body| S::ORDER > 0 && carries(&body.motion)) {
            Some(body) => Err(BuildError::TrajectoryDerivatives { body: body.name.clone() }),
            None => Ok(()),
        }
    }

    /// Refuses trajectories whose velocity is not the rate of their pose, at some times between two \[s\].
    pub(crate) fn check_velocities(&self, [from, to]: [f64; 2]) -> Result<()> {
        for body in &self.bodies {
            let Motion::Kinematic(trajectory) = &body.motion else { continue };
            let plain = plain(trajectory);
            let state = |time: f64| match &plain {
                Some(plain) => plain.state(time),
                None => trajectory.state(time).value(),
            };
            let duration = to - from;
            let apart = APART.min(duration / 32.0);
            let times = TRIED.map(|part| from + part * duration);
            if let Some(time) = times.into_iter().find(|time| contradicts(state, *time, apart)) {
                return Err(SimulationError::TrajectoryVelocity { body: body.name.clone(), time });
            }
        }
        Ok(())
    }
}

/// When velocities are tried, in parts of a rollout: not before its start and after its end, where there may be no trajectory.
const TRIED: [f64; 4] = [0.07, 0.31, 0.58, 0.89];
/// Time between poses, at most \[s\].
const APART: f64 = 1e-4;
/// Error of a velocity that is no approximation, in parts of the rate.
const GROSS: f64 = 0.5;
/// Change of the rate of a pose next to a kink, or made of rounding, in parts of it.
const SMOOTH: f64 = 0.1;
/// Slower rates say nothing \[m/s\], \[rad/s\].
const SLOWEST: f64 = 1e-6;

/// True if the velocity of `state` at `time` \[s\] is far from the rate of its pose, where that is the same over times up to `apart`
/// \[s\] before and after.
fn contradicts(state: impl Fn(f64) -> BodyState, time: f64, apart: f64) -> bool {
    let BodyState { pose, linear, angular } = state(time);
    let rates = |step: f64| {
        let next = state(time + step).pose;
        let shift = next.translation.vector - pose.translation.vector;
        let turn = (next.rotation * pose.rotation.inverse()).scaled_axis();
        [shift / step, turn / step]
    };
    let velocities = [linear, angular];
    let far = |part: usize, rate: &Vector3<f64>| {
        rate.norm() > SLOWEST && (velocities[part] - rate).norm() > GROSS * rate.norm()
    };
    let ahead = rates(apart);
    // Mostly the first rate says that all is well.
    let suspects = (0..2).filter(|part| far(*part, &ahead[*part])).collect::<Vec<_>>();
    if suspects.is_empty() {
        return false;
    }
    let others = [-apart, 0.5 * apart, -0.5 * apart].map(rates);
    suspects.into_iter().any(|part| {
        let smooth = SMOOTH * ahead[part].norm();
        others.iter().all(|r| far(part, &r[part]) && (r[part] - ahead[part]).norm() < smooth)
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Isometry3;
    use prehend_autodiff::Fwd;

    use super::*;
    use crate::{Body, model::Trajectory};

    #[test]
    fn trajectories_that_carry_derivatives_are_refused() {
        let mut model = Model::new(Vector3::zeros());
        let still = |_: f64| BodyState::at_rest(Isometry3::identity());
        model.add(Body::kinematic("table", still));
        let mut lifted = model.cast::<Fwd<1>>();
        assert_eq!(lifted.check_trajectories(), Ok(()));
        let [speed] = Fwd::<1>::variables([0.2]);
        lifted.bodies[0].motion = Motion::Kinematic(Arc::new(move |time: f64| {
            let mut state = BodyState::at_rest(Isometry3::identity());
            state.pose.translation.x = speed.times(time);
            state
        }));
        let error = BuildError::TrajectoryDerivatives { body: "table".to_owned() };
        assert_eq!(lifted.check_trajectories(), Err(error.clone()));
        assert_eq!(lifted.with_parameters(&lifted.parameters()).unwrap_err(), error);
    }

    /// Result of a rollout of a second on a trajectory.
    fn refused(trajectory: impl Trajectory) -> Option<f64> {
        let mut model = Model::new(Vector3::zeros());
        model.add(Body::kinematic("table", trajectory));
        match model.simulate(&model.neutral_state(), 1.0) {
            Ok(_) => None,
            Err(SimulationError::TrajectoryVelocity { body, time }) => {
                assert_eq!(body, "table");
                Some(time)
            }
            Err(error) => panic!("{error}"),
        }
    }

    fn moving(pose: Vector3<f64>, velocity: Vector3<f64>) -> BodyState {
        let linear = velocity;
        BodyState { linear, ..BodyState::at_rest(Isometry3::new(pose, Vector3::zeros())) }
    }

    #[test]
    fn velocities_that_are_no_rates_are_refused() {
        let (x, z) = (Vector3::x(), Vector3::z());
        assert!(refused(move |t: f64| moving(x * 0.1 * t, Vector3::zeros())).is_some());
        assert!(refused(move |t: f64| moving(x * 0.1 * t, x * -0.1)).is_some());
        // It moves late.
        let late = refused(move |t: f64| moving(x * (t - 0.8).max(0.0), Vector3::zeros()));
        assert!(late.is_some_and(|time| time > 0.8));
        let turning = |angular: Vector3<f64>| {
            move |t: f64| BodyState {
                angular,
                ..BodyState::at_rest(Isometry3::new(Vector3::zeros(), z * 0.3 * t))
            }
        };
        assert!(refused(turning(Vector3::zeros())).is_some());
        assert_eq!(refused(turning(z * 0.3)), None);
    }

    #[test]
    fn kinks_jumps_belts_and_rough_clocks_are_allowed() {
        let x = Vector3::x();
        for kink in TRIED {
            let corner = move |t: f64| {
                let late = (t - kink).max(0.0);
                moving(x * 0.2 * late, x * if t < kink { 0.0 } else { 0.2 })
            };
            assert_eq!(refused(corner), None);
            let before = move |t: f64| {
                let late = (t - kink).max(0.0);
                moving(x * 0.2 * late, x * if t <= kink { 0.0 } else { 0.2 })
            };
            assert_eq!(refused(before), None);
            assert_eq!(refused(move |t: f64| moving(x * f64::from(t > kink), x * 0.0)), None);
            // Turns back, or stops without a kink.
            for power in [2, 3] {
                let slope = f64::from(power);
                let still = move |t: f64| {
                    moving(x * (t - kink).powi(power), x * slope * (t - kink).powi(power - 1))
                };
                assert_eq!(refused(still), None);
            }
        }
        assert_eq!(refused(move |_: f64| moving(x * 0.0, x * 0.3)), None);
        // Poses of few digits, and a table of them.
        assert_eq!(refused(move |t: f64| moving(x * f64::from(0.1 * t as f32), x * 0.1)), None);
        assert_eq!(refused(move |t: f64| moving(x * (50.0 * t).floor() * 2e-3, x * 0.1)), None);
    }
}
