//! The other poses that fit, as the last full estimate has them.

use std::sync::Arc;

use nalgebra::{Isometry3, UnitQuaternion};

use super::turned::Followed;
use super::{Solved, Tracker};
use crate::error::RefineError;
use crate::factor::GaussianPrior;
use crate::problem::State;
use crate::strategy::{Hypothesis, Posterior, ScaleMixture};

/// A pose that the object may have instead of that which is tracked.
#[derive(Clone, Copy, Debug)]
struct Mode {
    /// Coordinates of the object there → those of the object as it is tracked.
    in_object: Isometry3<f64>,
    /// Logarithm of its weight over that of the tracked pose.
    log_odds: f64,
}

/// Rotation from which an object is seen anew \[rad\].
const NEW_VIEW: f64 = 0.25;

/// Poses that the object may have instead of that which is tracked. They move with it. Their weights change with each new view, because frames of one view
/// err alike.
#[derive(Clone, Debug, Default)]
pub(super) struct Modes {
    others: Vec<Mode>,
    /// Object → camera, when they were last weighed.
    seen: UnitQuaternion<f64>,
    /// Uncertainty of scales in each.
    mixture: ScaleMixture,
}

impl Modes {
    /// Those of `posterior`.
    pub(super) fn new(posterior: &Posterior) -> Self {
        let [best, others @ ..] = &posterior.hypotheses[..] else { return Self::default() };
        let of = |pose: &Isometry3<f64>| best.t_cam_object.inverse() * pose;
        let mode = |other: &Hypothesis| Mode {
            in_object: of(&other.t_cam_object),
            log_odds: (other.weight / best.weight).ln(),
        };
        Self {
            others: others.iter().filter(|other| other.weight > 0.0).map(mode).collect(),
            seen: best.t_cam_object.rotation,
            mixture: posterior.mixture().clone(),
        }
    }

    /// Whether there are others, and an object turned by `rotation` shows more of which it is.
    pub(super) fn is_new_view(&self, rotation: &UnitQuaternion<f64>) -> bool {
        !self.others.is_empty() && self.seen.angle_to(rotation) > NEW_VIEW
    }

    /// Tracks the one at `index`, and has the tracked one in its place.
    fn swap(&mut self, index: usize) {
        let Mode { in_object, log_odds } = self.others[index];
        let back = in_object.inverse();
        for (k, mode) in self.others.iter_mut().enumerate() {
            *mode = match k == index {
                true => Mode { in_object: back, log_odds: -log_odds },
                false => {
                    Mode { in_object: back * mode.in_object, log_odds: mode.log_odds - log_odds }
                }
            };
        }
    }

    /// Gives `posterior`, which is of the tracked pose alone and with nominal scales, the others and the uncertainty of scales.
    pub(super) fn add_to(&self, posterior: &mut Posterior, radius: f64) {
        posterior.widen(&self.mixture, radius);
        let modes = self.others.iter().map(|mode| (mode.in_object, mode.log_odds));
        posterior.add_modes(modes);
    }
}

impl Tracker {
    /// Weighs `modes` by a frame that shows the object as none has before: another of them with its posterior, where that is now the likeliest.
    pub(super) fn weigh(
        &self,
        frame: &Followed<'_>,
        solved: &Solved,
        modes: &mut Modes,
    ) -> Result<Option<(Solved, Posterior)>, RefineError> {
        let pose = solved.solution.at.state.t_cam_object;
        let expected = &frame.prediction.state;
        modes.seen = pose.rotation;
        let mut best: Option<(usize, f64, Solved)> = None;
        for (k, mode) in modes.others.iter_mut().enumerate() {
            let start = State { t_cam_object: pose * mode.in_object, ..expected.clone() };
            let (layout, covariance) = (frame.prediction.layout, &frame.prediction.covariance);
            let Some(prior) = GaussianPrior::correlated(start.clone(), layout, covariance) else {
                continue;
            };
            let problem = frame.problem.clone().with_prior(Arc::new(prior));
            let mut found = problem.solve_all(&[start], &self.settings.stage.solver);
            let Some(solution) = found.pop() else { continue };
            let other = Solved { solution, tried: true };
            mode.log_odds += solved.cost() - other.cost();
            mode.in_object = pose.inverse() * other.solution.at.state.t_cam_object;
            if mode.log_odds > best.as_ref().map_or(0.0, |best| best.1) {
                best = Some((k, mode.log_odds, other));
            }
        }
        let Some((k, _, other)) = best else { return Ok(None) };
        let posterior = self.posterior(&other, frame.nominal)?;
        if self.gate(&other, &posterior, None, frame.level).is_some() {
            return Ok(None);
        }
        modes.swap(k);
        modes.seen = other.solution.at.state.t_cam_object.rotation;
        Ok(Some((other, posterior)))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn modes_that_change_places_keep_their_poses_and_odds() {
        let poses = [0.0, 1.0, -2.0].map(|angle| Isometry3::rotation(Vector3::z() * angle));
        let mode = |k: usize, log_odds: f64| Mode { in_object: poses[k], log_odds };
        let others = vec![mode(1, 0.5), mode(2, -1.0)];
        let mut modes = Modes { others, seen: UnitQuaternion::identity(), ..Modes::default() };
        modes.swap(0);
        let tracked = poses[1];
        for (mode, (pose, log_odds)) in
            modes.others.iter().zip([(poses[0], -0.5), (poses[2], -1.5)])
        {
            assert!((tracked * mode.in_object).rotation.angle_to(&pose.rotation) < 1e-12);
            assert!((mode.log_odds - log_odds).abs() < 1e-12);
        }
        assert!(modes.is_new_view(&UnitQuaternion::from_scaled_axis(Vector3::x() * 0.3)));
        assert!(!modes.is_new_view(&UnitQuaternion::from_scaled_axis(Vector3::x() * 0.2)));
    }
}
