//! The other poses that fit: of the last full estimate, and turned about the axis of rotation that is known least.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3};
use prehend_render::Camera;

use super::memory::Prediction;
use super::{Solved, Tracker};
use crate::error::RefineError;
use crate::factor::GaussianPrior;
use crate::problem::{Problem, State};
use crate::strategy::{Posterior, PosteriorMode, ScaleMixture};

/// A pose that the object may have instead of that which is tracked.
#[derive(Clone, Copy, Debug)]
struct TrackedMode {
    /// Coordinates of the object there → those of the object as it is tracked.
    in_object: Isometry3<f64>,
    /// Logarithm of its weight over that of the tracked pose.
    log_odds: f64,
}

/// Poses that the object may have instead of that which is tracked. They move with it. Their weights change with each new view, because frames of one view
/// err alike.
#[derive(Clone, Debug, Default)]
pub(super) struct Modes {
    others: Vec<TrackedMode>,
    /// Object → camera, when they were last weighed.
    seen: UnitQuaternion<f64>,
    /// Uncertainty of scales in each.
    mixture: ScaleMixture,
}

impl Modes {
    /// Those of `posterior`.
    pub(super) fn new(posterior: &Posterior) -> Self {
        let [best, others @ ..] = &posterior.modes[..] else { return Self::default() };
        let mode = |other: &PosteriorMode| TrackedMode {
            in_object: best.t_cam_object.inverse() * other.t_cam_object,
            log_odds: (other.weight / best.weight).ln(),
        };
        Self {
            others: others.iter().filter(|other| other.weight > 0.0).map(mode).collect(),
            seen: best.t_cam_object.rotation,
            mixture: posterior.mixture().clone(),
        }
    }

    /// True if an object turned by `rotation`, by more than an `angle` \[rad\], shows more of which it is.
    pub(super) fn is_new_view(&self, rotation: &UnitQuaternion<f64>, angle: f64) -> bool {
        self.seen.angle_to(rotation) > angle
    }

    /// Tracks the one at `index`, and has the tracked one in its place.
    fn swap(&mut self, index: usize) {
        let TrackedMode { in_object, log_odds } = self.others[index];
        let back = in_object.inverse();
        for (k, mode) in self.others.iter_mut().enumerate() {
            *mode = match k == index {
                true => TrackedMode { in_object: back, log_odds: -log_odds },
                false => TrackedMode {
                    in_object: back * mode.in_object,
                    log_odds: mode.log_odds - log_odds,
                },
            };
        }
    }

    /// Adds poses turned by `turn` and back (rotation vectors in the object's frame, about its `center`), of odds that are even so far.
    fn add_turned(&mut self, turn: &Vector3<f64>, center: &Vector3<f64>) {
        for turn in [*turn, -turn] {
            let rotation = UnitQuaternion::from_scaled_axis(turn);
            let in_object = Isometry3::from_parts((center - rotation * center).into(), rotation);
            self.others.push(TrackedMode { in_object, log_odds: 0.0 });
        }
    }

    /// Leaves out those of hardly any weight, and those turned as the tracked one or another, within an `angle` \[rad\].
    fn prune(&mut self, least: f64, angle: f64) {
        let mut kept: Vec<TrackedMode> = Vec::new();
        for mode in self.others.drain(..) {
            let rotation = mode.in_object.rotation;
            let is_same =
                |other: &TrackedMode| other.in_object.rotation.angle_to(&rotation) < angle;
            let is_tracked = rotation.angle() < angle;
            if mode.log_odds > least && !is_tracked && !kept.iter().any(is_same) {
                kept.push(mode);
            }
        }
        self.others = kept;
    }

    /// Gives `posterior`, which is of the tracked pose alone and with nominal scales, the others and the uncertainty of scales.
    pub(super) fn add_to(&self, posterior: &mut Posterior, radius: f64) {
        posterior.widen(&self.mixture, radius);
        let modes = self.others.iter().map(|mode| (mode.in_object, mode.log_odds));
        posterior.add_modes(modes);
    }
}

/// A frame that is tracked, and what is needed to solve it from elsewhere.
pub(super) struct Followed<'a> {
    pub(super) camera: &'a Camera,
    pub(super) problem: &'a Problem,
    pub(super) prediction: &'a Prediction,
    pub(super) nominal: &'a State,
    /// Level of the costs of poses that are believed \[nat\].
    pub(super) level: f64,
}

impl Tracker {
    /// Weighs `modes` by a frame that shows the object as none has before: another of them with its posterior, where that is now the likeliest.
    ///
    /// Where the rotation of `solved` is uncertain by `posterior`, poses turned about that axis are modes, too: following alone does not leave a wrong minimum
    /// of a rotation that colors tell.
    pub(super) fn weigh(
        &self,
        frame: &Followed<'_>,
        solved: &Solved,
        posterior: &Posterior,
        modes: &mut Modes,
    ) -> Result<Option<(Solved, Posterior)>, RefineError> {
        let pose = solved.solution.at.state.t_cam_object;
        let (variance, axis) = widest(posterior.covariance().fixed_view::<3, 3>(3, 3).into_owned());
        if variance > self.settings.turn_sigma.powi(2) {
            let turn = pose.rotation.inverse() * axis * self.settings.turn;
            modes.add_turned(&turn, &self.object.center.coords);
        }
        modes.seen = pose.rotation;
        let Prediction { state: expected, covariance, .. } = frame.prediction;
        let mut best: Option<(f64, Isometry3<f64>, Solved)> = None;
        for mode in &mut modes.others {
            let start = State { t_cam_object: pose * mode.in_object, ..expected.clone() };
            let Some(prior) = GaussianPrior::correlated(start.clone(), covariance) else {
                continue;
            };
            let problem = frame.problem.clone().with_prior(Arc::new(prior));
            let mut found = problem.solve_all(&[start], &self.settings.stage.solver);
            let Some(solution) = found.pop() else { continue };
            let other = Solved { solution, tried: true };
            mode.log_odds += solved.cost() - other.cost();
            mode.in_object = pose.inverse() * other.solution.at.state.t_cam_object;
            if mode.log_odds > best.as_ref().map_or(0.0, |best| best.0) {
                best = Some((mode.log_odds, mode.in_object, other));
            }
        }
        let least = -self.settings.fused.hypotheses.prune_margin;
        modes.prune(least, 0.5 * self.settings.turn);
        let Some((_, in_object, other)) = best else { return Ok(None) };
        let posterior = self.posterior(frame.camera, &other, frame.nominal)?;
        let index = modes.others.iter().position(|mode| mode.in_object == in_object);
        let (Some(index), None) = (index, self.gate(&other, &posterior, None, frame.level)) else {
            return Ok(None);
        };
        modes.swap(index);
        modes.seen = other.solution.at.state.t_cam_object.rotation;
        Ok(Some((other, posterior)))
    }
}

/// The largest variance, and along which axis it is.
fn widest(covariance: Matrix3<f64>) -> (f64, Vector3<f64>) {
    let eigen = covariance.symmetric_eigen();
    let k = eigen.eigenvalues.imax();
    (eigen.eigenvalues[k], eigen.eigenvectors.column(k).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracker::TrackerSettings;

    fn modes(angles: &[(f64, f64)]) -> Modes {
        let mode = |&(angle, log_odds): &(f64, f64)| TrackedMode {
            in_object: Isometry3::rotation(Vector3::z() * angle),
            log_odds,
        };
        Modes { others: angles.iter().map(mode).collect(), ..Modes::default() }
    }

    #[test]
    fn modes_that_change_places_keep_their_poses_and_odds() {
        let mut modes = modes(&[(1.0, 0.5), (-2.0, -1.0)]);
        modes.swap(0);
        let tracked = Isometry3::rotation(Vector3::z());
        for (mode, (angle, log_odds)) in modes.others.iter().zip([(0.0, -0.5), (-2.0, -1.5)]) {
            let expected = UnitQuaternion::from_scaled_axis(Vector3::z() * angle);
            assert!((tracked * mode.in_object).rotation.angle_to(&expected) < 1e-12);
            assert!((mode.log_odds - log_odds).abs() < 1e-12);
        }
        assert!(modes.is_new_view(&UnitQuaternion::from_scaled_axis(Vector3::x() * 0.3), 0.26));
        assert!(!modes.is_new_view(&UnitQuaternion::from_scaled_axis(Vector3::x() * 0.2), 0.26));
    }

    #[test]
    fn turned_poses_keep_the_center_and_what_is_the_same_or_unlikely_goes() {
        let mut modes = modes(&[(0.05, 0.0), (1.0, -20.0), (2.0, -3.0), (2.02, -2.0)]);
        let center = Vector3::new(0.1, 0.2, 0.3);
        let turn = TrackerSettings::default().turn;
        modes.add_turned(&(Vector3::x() * turn), &center);
        modes.prune(-15.0, 0.5 * turn);
        let odds: Vec<f64> = modes.others.iter().map(|mode| mode.log_odds).collect();
        assert_eq!(odds, [-3.0, 0.0, 0.0]);
        for mode in &modes.others[1..] {
            assert!(
                (mode.in_object * nalgebra::Point3::from(center) - center).coords.norm() < 1e-12
            );
            assert!((mode.in_object.rotation.angle() - turn).abs() < 1e-12);
        }
    }
}
