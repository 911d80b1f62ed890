//! Whether the object is turned otherwise than it is followed.

use std::sync::Arc;
use std::time::Duration;

use nalgebra::{Matrix3, Vector3};
use prehend_autodiff::lie::so3_log;

use super::memory::Prediction;
use super::{Solved, Tracker};
use crate::error::RefineError;
use crate::factor::GaussianPrior;
use crate::problem::{Block, Problem, State};
use crate::strategy::Posterior;

/// Angle between the pose that is followed and the starts of others \[rad\].
const TURN: f64 = 10.0 / 180.0 * std::f64::consts::PI;
/// A solution that is nearer to the pose that is followed than this share of the angle is in the same minimum.
const SAME_MINIMUM: f64 = 0.5;
/// Gain of a frame at which a sum stays as it is, and the sum above which a turned pose is taken, which is also the most that a frame counts \[nat\].
const SLACK: f64 = 1.0;
const THRESHOLD: f64 = 6.0;
/// Cosine of the angle between the axes of two frames above which they are the same.
const SAME_AXIS: f64 = 0.9;
/// Below this visible share of the object, errors about what hides it exceed the differences of costs.
const LEAST_VISIBLE: f32 = 0.3;

/// By how much poses turned about an axis have fitted better than the one that is followed: cumulative sums (Page, 1954).
#[derive(Clone, Debug, Default)]
pub(super) struct TurnedPoses {
    /// In the object's frame; zero before the first.
    axis: Vector3<f64>,
    /// Of a negative and of a positive turn \[nat\].
    pub(super) sums: [f64; 2],
}

impl TurnedPoses {
    /// The axis, in the sense in which it was used before.
    fn oriented(&self, axis: Vector3<f64>) -> Vector3<f64> {
        if axis.dot(&self.axis) < 0.0 { -axis } else { axis }
    }

    /// Adds by how much poses turned about `axis` fit better in one frame \[nat\]: which of them, if one, has now fitted better in enough frames.
    fn add(&mut self, axis: &Vector3<f64>, gains: [f64; 2]) -> Option<usize> {
        if axis.dot(&self.axis) < SAME_AXIS {
            self.sums = [0.0; 2];
        }
        self.axis = *axis;
        for (sum, gain) in self.sums.iter_mut().zip(gains) {
            // Written so that what is not a number counts as none.
            let gain = if gain > THRESHOLD { THRESHOLD } else { gain };
            *sum = (*sum + gain - SLACK).max(0.0);
        }
        let best = usize::from(self.sums[1] > self.sums[0]);
        (self.sums[best] > THRESHOLD).then_some(best)
    }
}

/// A frame that is followed, and what is needed to solve it from elsewhere.
pub(super) struct Followed<'a> {
    pub(super) problem: &'a Problem,
    pub(super) prediction: &'a Prediction,
    pub(super) nominal: &'a State,
    /// Level of the costs of poses that are believed \[nat\].
    pub(super) level: f64,
}

impl Tracker {
    /// How long [`try_turned`](Self::try_turned) takes at most where the steps to `solved` took `steps`.
    pub(super) fn time_of_turned(&self, solved: &Solved, steps: Duration) -> Duration {
        let most = 2 * (1 + self.settings.stage.solver.iterations);
        steps.mul_f64(most as f64 / (1 + solved.solution.iterations) as f64)
    }

    /// A pose that is turned about the axis about which `posterior` knows least, and has fitted better than the pose that is followed in this frame and
    /// others: following does not leave a wrong minimum of a rotation that colors tell.
    pub(super) fn try_turned(
        &self,
        frame: &Followed<'_>,
        solved: &Solved,
        posterior: &Posterior,
        turned: &mut TurnedPoses,
    ) -> Result<Option<(Solved, Posterior)>, RefineError> {
        let at = &solved.solution.at.state;
        let rotations: Matrix3<f64> = posterior.covariance().fixed_view::<3, 3>(3, 3).into_owned();
        let (variance, axis) = widest(rotations);
        let visible = self.segmenter.visible_share();
        if variance < self.settings.turn_sigma.powi(2) || visible < LEAST_VISIBLE {
            return Ok(None);
        }
        let to_camera = at.t_cam_object.rotation;
        let in_object = turned.oriented(to_camera.inverse() * axis);
        let axis = to_camera * in_object;
        // Frames before, which were followed, may have told of the wrong minimum.
        let mut covariance = frame.prediction.covariance.clone();
        let mut rotations = covariance.fixed_view_mut::<3, 3>(3, 3);
        rotations += axis * axis.transpose() * TURN.powi(2);
        let (expected, layout) = (frame.prediction.state.clone(), frame.prediction.layout);
        let Some(prior) = GaussianPrior::correlated(expected, layout, &covariance) else {
            return Ok(None);
        };
        let prior = Arc::new(prior);
        let problem = frame.problem.clone().with_prior(prior.clone());
        let starts = [-TURN, TURN].map(|angle| {
            let turn = axis * angle;
            at.retract(&[Block::ObjectPose], &[0.0, 0.0, 0.0, turn.x, turn.y, turn.z])
        });
        let mut found = problem.solve_all(&starts, &self.settings.stage.solver);
        let gains = [0, 1].map(|k| {
            let turn = found[k].at.state.t_cam_object.rotation * to_camera.inverse();
            let is_same = so3_log(&turn).dot(&axis).abs() < SAME_MINIMUM * TURN;
            if is_same { 0.0 } else { solved.cost() - found[k].at.cost_of_factors() }
        });
        let Some(best) = turned.add(&in_object, gains) else { return Ok(None) };
        *turned = TurnedPoses::default();
        let solved = Solved { solution: found.swap_remove(best), tried: true };
        let posterior = self.posterior(&solved, frame.nominal)?;
        let doubt = self.gate(&solved, &posterior, Some(&prior), frame.level);
        Ok(doubt.is_none().then_some((solved, posterior)))
    }
}

/// The largest variance, and along which axis it is.
pub(super) fn widest(covariance: Matrix3<f64>) -> (f64, Vector3<f64>) {
    let eigen = covariance.symmetric_eigen();
    let k = eigen.eigenvalues.imax();
    (eigen.eigenvalues[k], eigen.eigenvectors.column(k).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_that_fits_better_in_several_frames_is_taken() {
        let mut turned = TurnedPoses::default();
        let axis = Vector3::z();
        // However much better it fits in one.
        assert_eq!(turned.add(&axis, [-3.0, 50.0]), None);
        assert_eq!(turned.add(&axis, [3.0, -3.0]), None);
        assert_eq!(turned.sums, [2.0, 1.0]);
        assert_eq!(turned.add(&axis, [f64::NAN, 9.0]), None);
        assert_eq!(turned.sums, [0.0, 6.0]);
        assert_eq!(turned.add(&axis, [-9.0, 1.5]), Some(1));
        // What is said of another axis has no part in it.
        assert_eq!(turned.add(&Vector3::x(), [-9.0, 3.0]), None);
        assert_eq!(turned.sums, [0.0, 2.0]);
        assert_eq!(turned.oriented(-Vector3::x()), Vector3::x());
    }

    #[test]
    fn the_widest_axis_is_that_of_the_largest_variance() {
        let (variance, axis) = widest(Matrix3::from_diagonal(&Vector3::new(1.0, 4.0, 2.0)));
        assert!((variance - 4.0).abs() < 1e-12 && axis.y.abs() > 1.0 - 1e-12);
    }
}
