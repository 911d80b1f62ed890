//! Whether the object is turned otherwise than it is followed.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};

use super::memory::Prediction;
use super::{Solved, Tracker};
use crate::error::RefineError;
use crate::factor::GaussianPrior;
use crate::problem::{Block, Problem, State};
use crate::strategy::Posterior;

/// How far from the pose that is followed others are begun at \[rad\].
const TURN: f64 = 10.0 / 180.0 * std::f64::consts::PI;
/// By how much a pose must fit better in one frame to count, and beyond that in all to be taken \[nat\].
const ALLOWANCE: f64 = 1.0;
const ENOUGH: f64 = 6.0;
/// Cosine of the angle between the axes of two frames at which they are still the same.
const SAME_AXIS: f64 = 0.9;
/// Of an object of which less is visible, what hides it errs by more than the poses differ.
const LEAST_VISIBLE: f32 = 0.3;

/// By how much poses that are turned about an axis have fitted better than the one that is followed: cumulative sums (Page, 1954).
#[derive(Clone, Debug, Default)]
pub(super) struct Rivals {
    /// In the object's frame; zero before the first.
    axis: Vector3<f64>,
    /// Turned back and on \[nat\].
    gains: [f64; 2],
}

impl Rivals {
    /// The axis, in the sense in which it was used before.
    fn oriented(&self, axis: Vector3<f64>) -> Vector3<f64> {
        if axis.dot(&self.axis) < 0.0 { -axis } else { axis }
    }

    /// Adds by how much poses turned about `axis`, back and on, fit better in one frame \[nat\]; which of them has fitted better for long enough, if
    /// one has.
    fn add(&mut self, axis: &Vector3<f64>, gains: [f64; 2]) -> Option<usize> {
        if axis.dot(&self.axis) < SAME_AXIS {
            self.gains = [0.0; 2];
        }
        self.axis = *axis;
        for (sum, gain) in self.gains.iter_mut().zip(gains) {
            *sum = (*sum + gain - ALLOWANCE).max(0.0);
        }
        let best = usize::from(self.gains[1] > self.gains[0]);
        (self.gains[best] > ENOUGH).then_some(best)
    }
}

/// What a frame that is followed is compared in.
pub(super) struct Comparison<'a> {
    pub(super) problem: &'a Problem,
    pub(super) prediction: &'a Prediction,
    pub(super) nominal: &'a State,
    /// Level of the costs of poses that are believed \[nat\].
    pub(super) level: f64,
}

impl Tracker {
    /// A pose that is turned about the axis about which `posterior` knows least, and has fitted better than those that were followed in this frame and
    /// others. What only colors tell has many minima, and following does not leave one.
    pub(super) fn rival(
        &self,
        frame: &Comparison<'_>,
        followed: &Solved,
        posterior: &Posterior,
        rivals: &mut Rivals,
    ) -> Result<Option<(Solved, Posterior)>, RefineError> {
        let at = &followed.solution.at.state;
        let rotations: Matrix3<f64> = posterior.covariance().fixed_view::<3, 3>(3, 3).into_owned();
        let (variance, axis) = widest(rotations);
        let visible = self.segmenter.visible_share();
        if variance < self.settings.turn_sigma.powi(2) || visible < LEAST_VISIBLE {
            *rivals = Rivals::default();
            return Ok(None);
        }
        let to_camera = at.t_cam_object.rotation;
        let in_object = rivals.oriented(to_camera.inverse() * axis);
        let axis = to_camera * in_object;
        // Frames before, which were followed, may have told of the wrong minimum.
        let mut covariance = frame.prediction.covariance.clone();
        let mut rotations = covariance.fixed_view_mut::<3, 3>(3, 3);
        rotations += axis * axis.transpose() * TURN.powi(2);
        let (expected, layout) = (frame.prediction.state.clone(), frame.prediction.layout);
        let Some(prior) = GaussianPrior::correlated(expected, layout, &covariance) else {
            return Ok(None);
        };
        let problem = frame.problem.clone().with_prior(Arc::new(prior));
        let starts = [-TURN, TURN].map(|angle| {
            let turn = axis * angle;
            at.retract(&[Block::ObjectPose], &[0.0, 0.0, 0.0, turn.x, turn.y, turn.z])
        });
        let mut found = problem.solve_all(&starts, &self.settings.stage.solver);
        let gains = [0, 1].map(|k| followed.cost() - found[k].at.cost_of_factors());
        let Some(best) = rivals.add(&in_object, gains) else { return Ok(None) };
        *rivals = Rivals::default();
        let solved = Solved { solution: found.swap_remove(best), tried: true };
        let posterior = self.posterior(&solved, frame.nominal)?;
        let doubt = self.gate(&solved, &posterior, None, frame.level);
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
    fn one_that_fits_better_again_and_again_is_taken() {
        let mut rivals = Rivals::default();
        let axis = Vector3::z();
        assert_eq!(rivals.add(&axis, [-3.0, 6.5]), None);
        assert_eq!(rivals.add(&axis, [2.0, -1.0]), None);
        assert_eq!(rivals.gains, [1.0, 3.5]);
        assert_eq!(rivals.add(&axis, [-9.0, 4.0]), Some(1));
        // What is said of another axis has no part in it.
        assert_eq!(rivals.add(&Vector3::x(), [-9.0, 4.0]), None);
        assert_eq!(rivals.gains, [0.0, 3.0]);
        assert_eq!(rivals.oriented(-Vector3::x()), Vector3::x());
    }

    #[test]
    fn the_widest_axis_is_that_of_the_largest_variance() {
        let (variance, axis) = widest(Matrix3::from_diagonal(&Vector3::new(1.0, 4.0, 2.0)));
        assert!((variance - 4.0).abs() < 1e-12 && axis.y.abs() > 1.0 - 1e-12);
    }
}
