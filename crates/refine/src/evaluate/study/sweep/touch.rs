//! Taxels that fail.

use nalgebra::Vector3;
use prehend_geometry::SplitMix64;

use super::hand::direction;
use crate::scene::Observation;

/// A share of the taxels feels nothing.
pub(super) fn silence(observation: &mut Observation, share: f64, random: &mut SplitMix64) {
    for force in observation.hand.iter_mut().flat_map(|hand| &mut hand.forces) {
        if random.uniform() < share {
            *force = Vector3::zeros();
        }
    }
}

/// A share of the taxels feels forces that are not there, in any direction and on average as large as those that are.
pub(super) fn invent(observation: &mut Observation, share: f64, random: &mut SplitMix64) {
    let Some(hand) = &mut observation.hand else { return };
    let sizes: Vec<f64> = hand.forces.iter().map(|f| f.norm()).filter(|&f| f > 0.0).collect();
    let mean = if sizes.is_empty() { 1.0 } else { sizes.iter().sum::<f64>() / sizes.len() as f64 };
    for force in &mut hand.forces {
        let (chosen, size) = (random.uniform() < share, -mean * (1.0 - random.uniform()).ln());
        let invented = size * direction(random);
        if chosen {
            *force = invented;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::square;
    use super::*;

    fn forces(change: fn(&mut Observation, f64, &mut SplitMix64), share: f64) -> Vec<Vector3<f64>> {
        let mut observation = square();
        change(&mut observation, share, &mut SplitMix64::new(8));
        observation.hand.unwrap().forces
    }

    #[test]
    fn shares_fail_and_those_of_more_include_those_of_less() {
        let before = square().hand.unwrap().forces;
        for change in [silence, invent] {
            let failed = |share: f64| -> Vec<bool> {
                forces(change, share).iter().zip(&before).map(|(a, b)| a != b).collect()
            };
            let (some, more) = (failed(0.25), failed(0.75));
            assert!(some.iter().zip(&more).all(|(some, more)| !some || *more));
            let count = |failed: &[bool]| failed.iter().filter(|f| **f).count();
            // Half of the taxels feel nothing to begin with.
            let all = if forces(change, 1.0)[0].norm() == 0.0 { 50 } else { 100 };
            assert_eq!(count(&failed(1.0)), all);
            assert!((all / 8..all / 2).contains(&count(&some)), "{}", count(&some));
        }
        let invented = forces(invent, 1.0);
        let mean = invented.iter().map(|f| f.norm()).sum::<f64>() / 100.0;
        assert!((0.7..1.4).contains(&mean), "{mean}");
    }
}
