//! A hand that is not where it is said to be, and taxels that fail.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use prehend_geometry::SplitMix64;

use crate::scene::HandMeasurement;
use crate::synth::random_direction;

/// Shifts the hand by `distance` \[m\].
pub(super) fn shift(hand: &mut HandMeasurement, distance: f64, random: &mut SplitMix64) {
    hand.t_cam_hand = Translation3::from(distance * random_direction(random)) * hand.t_cam_hand;
}

/// Turns the hand by `angle` \[rad\] about its base.
pub(super) fn turn(hand: &mut HandMeasurement, angle: f64, random: &mut SplitMix64) {
    let turn = UnitQuaternion::new(angle * random_direction(random));
    let Isometry3 { rotation, translation } = hand.t_cam_hand;
    hand.t_cam_hand = Isometry3::from_parts(translation, turn * rotation);
}

/// Moves every joint by `angle` \[rad\], one way or the other.
pub(super) fn bend(hand: &mut HandMeasurement, angle: f64, random: &mut SplitMix64) {
    for joint in &mut hand.joints {
        *joint += if random.uniform() < 0.5 { angle } else { -angle };
    }
}

/// A share of the taxels feels nothing.
pub(super) fn silence(hand: &mut HandMeasurement, share: f64, random: &mut SplitMix64) {
    for force in &mut hand.forces {
        if random.uniform() < share && !HandMeasurement::is_unknown(force) {
            *force = Vector3::zeros();
        }
    }
}

/// A share of the taxels feels forces that are not there, in any direction and on average as large as those that are.
pub(super) fn invent(hand: &mut HandMeasurement, share: f64, random: &mut SplitMix64) {
    let sizes: Vec<f64> = hand.forces.iter().map(|f| f.norm()).filter(|&f| f > 0.0).collect();
    let mean = if sizes.is_empty() { 1.0 } else { sizes.iter().sum::<f64>() / sizes.len() as f64 };
    for force in &mut hand.forces {
        let (chosen, size) = (random.uniform() < share, -mean * (1.0 - random.uniform()).ln());
        let invented = size * random_direction(random);
        if chosen {
            *force = invented;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::square;
    use super::*;

    fn after(
        change: fn(&mut HandMeasurement, f64, &mut SplitMix64),
        amount: f64,
    ) -> HandMeasurement {
        let mut hand = square().hand.unwrap();
        change(&mut hand, amount, &mut SplitMix64::new(8));
        hand
    }

    #[test]
    fn the_hand_is_off_by_what_was_asked_for() {
        let before = square().hand.unwrap();
        let shifted = after(shift, 0.01).t_cam_hand;
        let off = shifted.translation.vector - before.t_cam_hand.translation.vector;
        assert!((off.norm() - 0.01).abs() < 1e-12);
        assert_eq!(shifted.rotation, before.t_cam_hand.rotation);
        let turned = after(turn, 0.05).t_cam_hand;
        assert_eq!(turned.translation, before.t_cam_hand.translation);
        assert!((turned.rotation.angle_to(&before.t_cam_hand.rotation) - 0.05).abs() < 1e-9);
        let bent = after(bend, 0.02).joints;
        let off: Vec<f64> = bent.iter().zip(&before.joints).map(|(a, b)| a - b).collect();
        assert!(off.iter().all(|d| (d.abs() - 0.02).abs() < 1e-12));
        assert!(off.iter().any(|&d| d > 0.0) && off.iter().any(|&d| d < 0.0));
    }

    #[test]
    fn shares_of_the_taxels_fail_and_those_of_more_include_those_of_less() {
        let before = square().hand.unwrap().forces;
        for change in [silence, invent] {
            let failed = |share: f64| -> Vec<bool> {
                after(change, share).forces.iter().zip(&before).map(|(a, b)| a != b).collect()
            };
            let (some, more) = (failed(0.25), failed(0.75));
            assert!(some.iter().zip(&more).all(|(some, more)| !some || *more));
            let count = |failed: &[bool]| failed.iter().filter(|f| **f).count();
            // Half of the taxels feel nothing to begin with.
            let all = if after(change, 1.0).forces[0].norm() == 0.0 { 50 } else { 100 };
            assert_eq!(count(&failed(1.0)), all);
            assert!((all / 8..all / 2).contains(&count(&some)), "{}", count(&some));
        }
        let invented = after(invent, 1.0).forces;
        let mean = invented.iter().map(|f| f.norm()).sum::<f64>() / 100.0;
        assert!((0.7..1.4).contains(&mean), "{mean}");
    }
}
