//! A hand that is not where it is said to be.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use prehend_geometry::SplitMix64;

use crate::scene::Observation;

/// Shifts the hand by `distance` \[m\].
pub(super) fn shift(observation: &mut Observation, distance: f64, random: &mut SplitMix64) {
    let shift = Translation3::from(distance * direction(random));
    if let Some(hand) = &mut observation.hand {
        hand.t_cam_hand = shift * hand.t_cam_hand;
    }
}

/// Turns the hand by `angle` \[rad\] about its base.
pub(super) fn turn(observation: &mut Observation, angle: f64, random: &mut SplitMix64) {
    let turn = UnitQuaternion::new(angle * direction(random));
    if let Some(hand) = &mut observation.hand {
        let Isometry3 { rotation, translation } = hand.t_cam_hand;
        hand.t_cam_hand = Isometry3::from_parts(translation, turn * rotation);
    }
}

/// Moves every joint by `angle` \[rad\], one way or the other.
pub(super) fn bend(observation: &mut Observation, angle: f64, random: &mut SplitMix64) {
    for joint in observation.hand.iter_mut().flat_map(|hand| &mut hand.joints) {
        *joint += if random.uniform() < 0.5 { angle } else { -angle };
    }
}

/// Any direction, none more likely than another.
pub(super) fn direction(random: &mut SplitMix64) -> Vector3<f64> {
    let drawn = Vector3::from_fn(|_, _| random.normal());
    drawn.try_normalize(0.0).unwrap_or_else(Vector3::x)
}

#[cfg(test)]
mod tests {
    use super::super::tests::square;
    use super::*;

    #[test]
    fn the_hand_is_off_by_what_was_asked_for() {
        let before = square().hand.unwrap();
        let after = |change: fn(&mut Observation, f64, &mut SplitMix64), amount: f64| {
            let mut observation = square();
            change(&mut observation, amount, &mut SplitMix64::new(3));
            observation.hand.unwrap()
        };
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
}
