//! Dead taxels: they are silent where others would feel.

use nalgebra::Vector3;

use super::calibration::FELT;
use super::reading::SkinReading;

/// Share of taxels that are dead.
const DEAD_SHARE: f64 = 0.1;

/// Distances from the object \[m\] and forces around \[N\] between which taxels are alike; farther ones say nothing.
const DISTANCES: [f64; 4] = [1e-3, 2.5e-3, 4e-3, 6e-3];
const AROUND: [f64; 4] = [0.05, 0.2, 0.5, 1.5];
const KINDS: usize = DISTANCES.len() * (AROUND.len() + 1);

/// Rounds in which shares and probabilities are found from each other.
const ROUNDS: usize = 30;

/// How often each taxel was silent, by how much it should feel; and how often any was not.
#[derive(Clone, Default)]
pub(super) struct SilenceSums {
    silent: Vec<[f64; KINDS]>,
    felt: [f64; KINDS],
    has_felt: Vec<bool>,
}

impl SilenceSums {
    /// Adds what taxels feel without their offsets: `forces`.
    pub(super) fn add(&mut self, reading: &SkinReading, forces: &[Vector3<f64>], weight: f64) {
        self.silent.resize(forces.len(), [0.0; KINDS]);
        self.has_felt.resize(forces.len(), false);
        for (taxel, force) in forces.iter().enumerate() {
            let feels = force.norm() > FELT;
            self.has_felt[taxel] |= feels;
            let near = reading.distances[taxel];
            let Some(distance) = DISTANCES.iter().position(|limit| near < *limit) else { continue };
            if !force.norm().is_finite() {
                continue;
            }
            let around = reading.felt_around(taxel, forces);
            let around = AROUND.iter().filter(|limit| around >= **limit).count();
            let kind = distance * (AROUND.len() + 1) + around;
            let count = if feels { &mut self.felt[kind] } else { &mut self.silent[taxel][kind] };
            *count += weight;
        }
    }

    /// Probability that each taxel is dead; those that feel, or ring with an offset, are not.
    ///
    /// How often a taxel that is alive is silent, by how much it should feel, comes from the same frames: from all taxels, as far as they are
    /// alive (expectation and maximization).
    pub(super) fn solve(&self, offsets: &[Vector3<f64>]) -> Vec<f64> {
        let alive: Vec<bool> = self
            .has_felt
            .iter()
            .zip(offsets)
            .map(|(felt, o)| *felt || *o != Vector3::zeros())
            .collect();
        let prior = DEAD_SHARE / (1.0 - DEAD_SHARE);
        let mut dead: Vec<f64> =
            alive.iter().map(|alive| if *alive { 0.0 } else { DEAD_SHARE }).collect();
        for _ in 0..ROUNDS {
            let log_share: [f64; KINDS] = std::array::from_fn(|kind| {
                let silent = self.silent.iter().zip(&dead).map(|(s, dead)| s[kind] * (1.0 - dead));
                // With half an observation of both, beforehand.
                let silent = silent.sum::<f64>() + 0.5;
                (silent / (silent + self.felt[kind] + 0.5)).ln()
            });
            for (taxel, silent) in self.silent.iter().enumerate() {
                if !alive[taxel] {
                    let if_alive: f64 = silent.iter().zip(&log_share).map(|(n, log)| n * log).sum();
                    dead[taxel] = prior / (prior + if_alive.exp());
                }
            }
        }
        dead
    }
}

#[cfg(test)]
mod tests {
    use super::super::reading::tests::reading;
    use super::*;
    use crate::scene::default_scene;

    #[test]
    fn a_taxel_that_is_silent_amid_pressure_is_dead_and_an_untouched_one_is_as_before() {
        let scene = default_scene(1).unwrap();
        let mut reading = reading(&scene, Vector3::zeros());
        let mut strongest: Vec<usize> = (0..368).filter(|k| reading.distances[*k] < 2e-3).collect();
        let around = |k: &usize| reading.felt_around(*k, &reading.forces);
        strongest.sort_by(|a, b| around(b).total_cmp(&around(a)));
        let dead = strongest[0];
        reading.forces[dead] = Vector3::zeros();
        let far = (0..368).find(|k| reading.distances[*k] > 20e-3).unwrap();
        let mut sums = SilenceSums::default();
        let offsets = vec![Vector3::zeros(); 368];
        sums.add(&reading, &reading.forces, 1.0);
        let once = sums.solve(&offsets)[dead];
        // In other grasps.
        (0..4).for_each(|_| sums.add(&reading, &reading.forces, 1.0));
        let found = sums.solve(&offsets);
        assert!(once > 0.1 && found[dead] > 0.95 && found[dead] > once, "{once} {}", found[dead]);
        assert!((found[far] - DEAD_SHARE).abs() < 1e-9);
        let felt = (0..368).filter(|k| reading.forces[*k].norm() > FELT);
        assert!(felt.into_iter().all(|k| found[k] == 0.0));
        let mut rings = offsets.clone();
        rings[dead] = Vector3::x();
        assert_eq!(sums.solve(&rings)[dead], 0.0);
    }
}
