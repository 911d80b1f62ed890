//! The ready-made grasp as the hand moves and turns.

use std::sync::Arc;
use std::time::Duration;

use nalgebra::{Isometry3, Vector3, Vector6};
use prehend_autodiff::lie::perturb_about;
use prehend_geometry::SplitMix64;

use super::sensing::HeldObject;
use super::{Hand, Object, Observation, Scene, default_scene};
use crate::error::RefineError;

/// One moment of a [`Sequence`].
pub struct SequenceFrame {
    /// When it was taken.
    pub time: Duration,
    /// What the sensors say.
    pub observation: Observation,
    /// The true pose, object → camera \[m\].
    pub truth: Isometry3<f64>,
}

/// Frames whose truth is known.
pub struct Sequence {
    /// The object.
    pub object: Arc<Object>,
    /// The hand.
    pub hand: Arc<Hand>,
    /// A pose to start from in the first frame.
    pub initial: Isometry3<f64>,
    /// In order of time.
    pub frames: Vec<SequenceFrame>,
}

/// Time between frames: those of a camera of thirty a second.
const STEP: Duration = Duration::from_nanos(33_333_333);
/// How far the hand moves and turns to either side \[m; rad\], and how fast at most, in radians of its phase a second.
const SWAY: f64 = 0.04;
const TURN: f64 = 0.35;
const RATE: f64 = 1.8;
/// How far the object slides in the hand, to either side \[m\].
const SLIDE: f64 = 2e-3;

/// `count` frames of [`default_scene`], thirty a second: the hand sways and turns, by up to 7 cm and 36° a second, and the
/// bottle slides a little in it. `seed` decides noise and initial pose.
///
/// # Errors
/// If the built-in assets cannot be prepared.
pub fn default_sequence(seed: u64, count: usize) -> Result<Sequence, RefineError> {
    let Scene { observation, object, hand, truth, initial, .. } = default_scene(seed)?;
    let (camera, gravity) = (observation.camera, observation.gravity);
    let (start, joints) = observation
        .hand
        .map_or_else(|| (Isometry3::identity(), Vec::new()), |hand| (hand.t_cam_hand, hand.joints));
    let center = (truth * object.center).coords;
    let held = HeldObject { camera, object: &object, hand: &hand, joints: &joints, gravity };
    let mut noise = SplitMix64::new(seed ^ 0x5e9);
    let frame = |index: usize| {
        let time = STEP * index as u32;
        let phase = RATE * time.as_secs_f64();
        let sway = Vector6::new(
            SWAY * phase.sin(),
            0.5 * SWAY * (1.3 * phase).sin(),
            0.5 * SWAY * (0.7 * phase).sin(),
            TURN * phase.sin(),
            TURN * (0.8 * phase).sin(),
            0.5 * TURN * (1.1 * phase).sin(),
        );
        let t_cam_hand = perturb_about(&start, &center, &sway);
        let slide = Vector3::new(0.0, 0.0, SLIDE * (1.7 * phase).sin());
        let t_hand_object = start.inverse() * truth;
        let truth = t_cam_hand * Isometry3::from(slide) * t_hand_object;
        let observation = held.observe(&truth, &t_cam_hand, &mut noise);
        SequenceFrame { time, observation, truth }
    };
    let frames: Vec<SequenceFrame> = (0..count).map(frame).collect();
    Ok(Sequence { object, hand, initial, frames })
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    #[test]
    fn the_object_stays_in_the_hand_while_both_move() {
        let sequence = default_sequence(1, 4).unwrap();
        let place = |frame: &SequenceFrame| -> (Point3<f64>, Point3<f64>) {
            let hand = frame.observation.hand.as_ref().unwrap().t_cam_hand;
            let center = frame.truth * sequence.object.center;
            (center, hand.inverse() * center)
        };
        for pair in sequence.frames.windows(2) {
            let ((a, in_hand), (b, next_in_hand)) = (place(&pair[0]), place(&pair[1]));
            assert!((1e-3..4e-3).contains(&(a - b).norm()));
            assert!((in_hand - next_in_hand).norm() < 3e-4);
            assert_eq!(pair[1].time - pair[0].time, STEP);
            assert!(pair[0].observation.mask.count() > 1000);
        }
    }
}
