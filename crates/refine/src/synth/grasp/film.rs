//! Grasps one after the other, with the object dropped between them.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use prehend_geometry::SplitMix64;

use super::grasper::Grasper;
use super::trajectory::GraspSnapshot;
use crate::synth::error::SynthError;
use crate::synth::pose_noise::random_direction;

/// The part of a film before the object is dropped.
const BEFORE: f64 = 0.6;
/// Times that the hand takes to open, to stay so, and to close about the object again \[s\].
const OPENING: f64 = 0.15;
const EMPTY: f64 = 0.7;
/// The share of the joints' way to where they were when the hand is open.
const OPEN: f64 = 0.3;

impl Grasper<'_> {
    /// `steps` moments of a hand that drops the object on its way, and then holds it in another grasp; each grasp is the first that holds
    /// of the seeds from `first_seed` on, and from its complement.
    ///
    /// # Errors
    /// [`SynthError::Refused`] if none of `tries` seeds leads to one.
    pub fn dropping(
        &self,
        first_seed: u64,
        tries: u64,
        steps: usize,
    ) -> Result<Vec<GraspSnapshot>, SynthError> {
        let down = random_direction(&mut SplitMix64::new(first_seed)) * self.settings.gravity;
        let before = (BEFORE * steps as f64) as usize;
        let between = ((OPENING + EMPTY) / self.settings.frame_time) as usize;
        let between = between.min((steps - before).saturating_sub(1));
        let held = |first_seed: u64, count: usize, turn: UnitQuaternion<f64>| {
            self.first_that_holds(first_seed, tries, |grasp, seed| {
                self.moments(grasp, &mut SplitMix64::new(seed), count, &turn, &down)
            })
        };
        let mut moments = held(first_seed, before.max(1), UnitQuaternion::identity())?;
        let Some(dropped) = moments.last().cloned() else { return Ok(moments) };
        let after = held(!first_seed, steps - before - between, dropped.turn)?;
        if let Some(regrasped) = after.first() {
            let falling = |k: usize| self.fallen(&dropped, regrasped, k, between);
            moments.extend((1..=between).map(falling));
        }
        moments.extend(after);
        moments.truncate(steps);
        Ok(moments)
    }

    /// The moment number `k` of `count` between two grasps: the hand stands still, opens, and closes again.
    fn fallen(
        &self,
        dropped: &GraspSnapshot,
        regrasped: &GraspSnapshot,
        k: usize,
        count: usize,
    ) -> GraspSnapshot {
        let time = k as f64 * self.settings.frame_time;
        let opened = (time / OPENING).min(1.0);
        let closed = ((k as f64 / count.max(1) as f64 - 0.5) / 0.5).max(0.0);
        let joint = |(&from, &to): (&f64, &f64)| {
            let open = from * (1.0 - opened * (1.0 - OPEN));
            open + (to - open) * closed
        };
        let fall: Vector3<f64> = 0.5 * time * time * dropped.gravity;
        let t_hand_object: Isometry3<f64> = Translation3::from(fall) * dropped.t_hand_object;
        GraspSnapshot {
            t_hand_object,
            joints: dropped.joints.iter().zip(&regrasped.joints).map(joint).collect(),
            taxel_forces: vec![Vector3::zeros(); dropped.taxel_forces.len()],
            ..dropped.clone()
        }
    }
}
