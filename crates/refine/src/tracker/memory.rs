//! Track of an object from one frame to the next.

use std::time::Duration;

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Matrix6, UnitQuaternion, Vector3, Vector6};
use prehend_autodiff::lie::{perturb_about, so3_log};

use super::keyframe::{Keyframe, deviation};
use super::modes::Modes;
use super::settings::{ProcessNoise, TrackerSettings};
use crate::factor::PriorSettings;
use crate::problem::{Linearization, RIDGE, ScaledCholesky, State};
use crate::scene::CameraCalibrationError;

/// Measurements of a frame beside its images.
pub(super) struct Moment {
    pub(super) time: Duration,
    /// The hand as it is said to be, without errors of cameras.
    pub(super) nominal: State,
    /// Whether the hand is known.
    pub(super) in_hand: bool,
}

/// The last pose that was believed, and what was learnt with it.
#[derive(Clone, Debug)]
pub(super) struct TrackState {
    /// When that was.
    pub(super) time: Duration,
    /// The solution of that frame.
    pub(super) state: State,
    /// Whether the hand was known.
    in_hand: bool,
    /// The hand as it is, in the frame of the hand as it was said to be.
    hand_error: Isometry3<f64>,
    /// Joint positions as they are, less those that were said.
    joint_errors: Vec<f64>,
    /// Twist about the object's center, in the camera frame of then, relative to the hand where that was known
    /// \[m/s; rad/s\].
    velocity: Vector6<f64>,
    /// Covariance of the solution, in the order of its [`blocks`](State::blocks).
    covariance: DMatrix<f64>,
    /// Running level of the misfit \[nat\].
    pub(super) level: f64,
    /// Frames in which something was seen, but not believed, less those in which it was believed again; not below zero.
    pub(super) lost: u32,
    /// Frames since, and whether nothing was seen of it in the last one.
    misses: u32,
    unseen: bool,
    /// Frames in which it was followed.
    followed: u32,
    /// Other poses that fit.
    pub(super) modes: Modes,
    /// Keyframe of the object's appearance.
    pub(super) keyframe: Option<Keyframe>,
}

/// Prediction of a frame's state.
pub(super) struct Prediction {
    pub(super) state: State,
    pub(super) covariance: DMatrix<f64>,
    /// Where the object would be without its velocity.
    zero_velocity_pose: Isometry3<f64>,
    velocity: Vector6<f64>,
    pub(super) seconds: f64,
    /// Covariance of the motion from the last frame: a left twist about the object's center \[m², m rad, rad²\].
    pub(super) motion_covariance: Matrix6<f64>,
    /// The last keyframe, where images have measured the motion since.
    pub(super) keyframe: Option<Keyframe>,
}

impl Prediction {
    /// With the object moved to `t_cam_object` by a motion that was measured with an error of this covariance.
    pub(super) fn measure(&mut self, t_cam_object: Isometry3<f64>, covariance: &Matrix6<f64>) {
        self.state.t_cam_object = t_cam_object;
        let mut block = self.covariance.fixed_view_mut::<6, 6>(0, 0);
        block += covariance - self.motion_covariance;
        self.motion_covariance = *covariance;
    }
}

impl TrackState {
    /// Track at `at`, the solution of a frame.
    pub(super) fn new(
        moment: &Moment,
        at: &Linearization,
        prior: &PriorSettings,
        level: f64,
    ) -> Self {
        let &Moment { time, ref nominal, in_hand } = moment;
        let joints = at.state.joints.iter().zip(&nominal.joints);
        Self {
            time,
            state: at.state.clone(),
            in_hand,
            hand_error: nominal.t_cam_hand.inverse() * at.state.t_cam_hand,
            joint_errors: joints.map(|(is, said)| is - said).collect(),
            velocity: Vector6::zeros(),
            covariance: posterior(at, prior),
            level,
            lost: 0,
            misses: 0,
            unseen: false,
            followed: 0,
            modes: Modes::default(),
            keyframe: None,
        }
    }

    /// A frame in which the object was not followed, though something was `seen` where it should be.
    pub(super) fn missed(&mut self, seen: bool) {
        self.unseen = !seen;
        self.keyframe = None;
        self.misses = self.misses.saturating_add(1);
        self.lost = self.lost.saturating_add(u32::from(seen));
    }

    /// True if colors are to be learnt from this frame, one in a `period` ([`TrackerSettings::period`]): they change slowly.
    pub(super) fn is_time_to_learn(&self, period: u32) -> bool {
        self.followed.is_multiple_of(period)
    }

    /// Whether it was lost for so long that much may have happened to it.
    pub(super) fn is_long_lost(&self, period: u32) -> bool {
        self.misses >= period
    }

    /// Whether it is time to look for an object that is lost, and `seen` where it should be or not: often at first, where it comes into sight, and
    /// else every so many frames, because that takes long.
    pub(super) fn is_due(&self, seen: bool, period: u32) -> bool {
        if seen && self.unseen {
            return true;
        }
        self.misses.is_multiple_of(period) || self.misses.is_power_of_two() && self.misses < period
    }

    /// The level that misfits are judged by: it grows while the object is lost ([`GatingSettings::growth`](super::GatingSettings::growth)), because
    /// circumstances may have changed for good.
    pub(super) fn allowance(&self, growth: f64) -> f64 {
        self.level * (1.0 + growth * f64::from(self.lost))
    }

    /// The next of this memory: as [`new`](Self::new), and with the velocity between `prediction` and there.
    pub(super) fn followed(
        &self,
        mut next: Self,
        prediction: &Prediction,
        motion: &ProcessNoise,
    ) -> Self {
        next.followed = self.followed.wrapping_add(1);
        next.velocity = prediction.velocity;
        if prediction.seconds > 0.0 {
            let State { t_cam_object, object_center, .. } = &next.state;
            let moved = deviation(t_cam_object, &prediction.zero_velocity_pose, object_center);
            let measured = moved / prediction.seconds;
            next.velocity += motion.gain * (measured - next.velocity);
        }
        next
    }

    /// Prediction of the state at `moment`.
    pub(super) fn predict(
        &self,
        moment: &Moment,
        prior: &PriorSettings,
        settings: &TrackerSettings,
    ) -> Prediction {
        let &Moment { time, ref nominal, in_hand } = moment;
        let seconds = time.saturating_sub(self.time).as_secs_f64();
        let motion = settings.motion(in_hand);
        let kept = (-seconds / settings.time_constant).exp();
        let (with_hand, velocity) = if in_hand == self.in_hand {
            let moved = match in_hand {
                true => nominal.t_cam_hand * self.hand_error * self.state.t_cam_hand.inverse(),
                false => Isometry3::identity(),
            };
            (moved, both(&moved.rotation, &self.velocity))
        } else {
            // Velocities are of something else now.
            (Isometry3::identity(), Vector6::zeros())
        };
        let rest = with_hand * self.state.t_cam_object;
        let center = (rest * self.state.object_center).coords;
        let coasting = -settings.time_constant * (-seconds / settings.time_constant).exp_m1();
        let mut state = nominal.clone();
        state.t_cam_object = perturb_about(&rest, &center, &(velocity * coasting));
        if in_hand {
            state.t_cam_hand = nominal.t_cam_hand * part(&self.hand_error, kept);
            let errors = self.joint_errors.iter();
            state.joints.iter_mut().zip(errors).for_each(|(q, error)| *q += kept * error);
        }
        let camera = self.state.camera.parameters().map(|p| kept * p);
        state.camera = CameraCalibrationError::default().changed(&camera);
        if state.views.len() == self.state.views.len() {
            for (view, before) in state.views.iter_mut().zip(&self.state.views) {
                *view = view.changed(&before.parameters().map(|p| kept * p));
            }
        }
        let stated = variances(prior, &state);
        let covariance = if state.blocks() == self.state.blocks() {
            let transition = transition(&with_hand.rotation, kept, stated.len());
            &transition * &self.covariance * transition.transpose()
        } else {
            let mut fresh = DMatrix::from_diagonal(&stated);
            fresh.view_mut((0, 0), (6, 6)).copy_from(&self.covariance.view((0, 0), (6, 6)));
            fresh
        };
        // What is forgotten of calibrations returns to what was said of them (Ornstein and Uhlenbeck); what the object
        // does is not bounded.
        let mut growth = stated * (1.0 - kept * kept);
        for k in 0..3 {
            growth[k] = motion.translation.powi(2) * seconds;
            growth[3 + k] = motion.rotation.powi(2) * seconds;
        }
        let motion_covariance = Matrix6::from_diagonal(&growth.fixed_rows::<6>(0).into_owned());
        let covariance = covariance + DMatrix::from_diagonal(&growth);
        Prediction {
            state,
            covariance,
            zero_velocity_pose: rest,
            velocity,
            seconds,
            motion_covariance,
            keyframe: None,
        }
    }
}

/// `pose` by a part of its way from the identity.
fn part(pose: &Isometry3<f64>, part: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(so3_log(&pose.rotation) * part);
    Isometry3::from_parts((pose.translation.vector * part).into(), turn)
}

/// A twist with both its parts turned.
fn both(turn: &UnitQuaternion<f64>, twist: &Vector6<f64>) -> Vector6<f64> {
    let halves: [Vector3<f64>; 2] = [0, 3].map(|k| turn * twist.fixed_rows::<3>(k));
    Vector6::from_iterator(halves.iter().flatten().copied())
}

/// Transition matrix of the `n` errors of a state: twists turn with the hand, calibrations decay by `kept`.
fn transition(turn: &UnitQuaternion<f64>, kept: f64, n: usize) -> DMatrix<f64> {
    let mut transition = DMatrix::identity(n, n) * kept;
    let turn: Matrix3<f64> = turn.to_rotation_matrix().into_inner();
    for k in 0..4 {
        let factor = if k < 2 { 1.0 } else { kept };
        transition.fixed_view_mut::<3, 3>(3 * k, 3 * k).copy_from(&(turn * factor));
    }
    transition
}

/// Stated variances of all parameters of `state`.
fn variances(prior: &PriorSettings, state: &State) -> DVector<f64> {
    prior.all_sigmas(state).map(|sigma| sigma.powi(2))
}

/// Covariance of what was solved for, and the stated one of the rest.
fn posterior(at: &Linearization, prior: &PriorSettings) -> DMatrix<f64> {
    let mut covariance = DMatrix::from_diagonal(&variances(prior, &at.state));
    let Some(factor) = ScaledCholesky::new(at.equations.hessian(), RIDGE) else {
        return covariance;
    };
    let all = factor.inverse();
    let mut places = Vec::with_capacity(all.nrows());
    let mut first = 0;
    for block in at.state.blocks() {
        let next = first + block.dimension();
        if let Some(from) = at.equations.offset(block) {
            places.extend((first..next).zip(from..));
        }
        first = next;
    }
    for &(r, from) in &places {
        for &(c, to) in &places {
            covariance[(r, c)] = all[(from, to)];
        }
    }
    covariance
}
