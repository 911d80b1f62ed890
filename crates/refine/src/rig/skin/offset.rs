//! Taxels that ring false: they read the same force wherever they are.

use nalgebra::Vector3;

use super::calibration::FELT;
use super::reading::SkinReading;

/// A taxel so far from the object is not touched by it, whatever the pose is off by \[m\].
const AWAY: f64 = 8e-3;

/// A reading above is not silent \[N\].
const RINGING: f64 = 0.02;

/// Share of taxels that ring false.
const FALSE_SHARE: f64 = 0.03;

/// How often a taxel away from the object reads a force if it rings false, and if it does not.
const RINGS: (f64, f64) = (0.9, 0.02);

/// Odds from which that is told: those of two grasps, since in one a taxel may touch anything.
const CERTAIN: f64 = 9.0;

/// What rings false varies by no more than such a share of itself, and so much \[N\].
const VARIES: (f64, f64) = (0.3, 0.03);

/// What a taxel reads away from the object.
#[derive(Clone, Default)]
struct Away {
    silent: f64,
    ringing: f64,
    /// Of what it reads when it is not silent.
    sum: Vector3<f64>,
    squares: f64,
}

/// Of each taxel.
#[derive(Clone, Default)]
pub(super) struct OffsetSums(Vec<Away>);

impl OffsetSums {
    /// Number of taxels.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    pub(super) fn add(&mut self, reading: &SkinReading, weight: f64) {
        self.0.resize(reading.forces.len(), Away::default());
        let taxels = self.0.iter_mut().zip(&reading.forces).zip(&reading.distances);
        for ((away, force), distance) in taxels {
            let strength = force.norm();
            if *distance <= AWAY || !strength.is_finite() {
                continue;
            }
            if strength <= RINGING {
                away.silent += weight;
                continue;
            }
            away.ringing += weight;
            away.sum += force * weight;
            away.squares += strength * strength * weight;
        }
    }

    /// The offset of each taxel \[N\], zero where it does not ring false.
    pub(super) fn solve(&self) -> Vec<Vector3<f64>> {
        self.0.iter().map(|away| away.offset().unwrap_or_else(Vector3::zeros)).collect()
    }
}

impl Away {
    /// What it rings with, if that is likely enough and no noise.
    fn offset(&self) -> Option<Vector3<f64>> {
        let (if_false, if_not) = RINGS;
        let log_odds = (FALSE_SHARE / (1.0 - FALSE_SHARE)).ln()
            + self.ringing * (if_false / if_not).ln()
            + self.silent * ((1.0 - if_false) / (1.0 - if_not)).ln();
        let mean = self.sum / self.ringing;
        let varies = (self.squares / self.ringing - mean.norm_squared()).max(0.0).sqrt();
        let (share, least) = VARIES;
        let is_constant = varies < share * mean.norm() + least;
        (log_odds > CERTAIN.ln() && mean.norm() > FELT && is_constant).then_some(mean)
    }
}

#[cfg(test)]
mod tests {
    use super::super::reading::tests::reading;
    use super::*;
    use crate::scene::default_scene;

    #[test]
    fn what_rings_away_from_the_object_is_found_and_what_is_touched_is_not() {
        let scene = default_scene(1).unwrap();
        let clean = reading(&scene, Vector3::zeros());
        let far: Vec<usize> = (0..368).filter(|k| clean.distances[*k] > 20e-3).collect();
        let (constant, once, wild) = (far[0], far[1], far[2]);
        let mut sums = OffsetSums::default();
        for k in 0..4 {
            let mut reading = clean.clone();
            let wobble = 5e-3 * f64::from(k - 2);
            reading.forces[constant] = Vector3::new(0.2 + wobble, -0.1, 0.05);
            reading.forces[wild] = Vector3::ith(k as usize % 3, 0.3 * f64::from(1 - k % 2 * 2));
            if k == 0 {
                reading.forces[once] = Vector3::z();
            }
            sums.add(&reading, 1.0);
        }
        let offsets = sums.solve();
        assert!((offsets[constant] - Vector3::new(0.1975, -0.1, 0.05)).norm() < 1e-9);
        let others = offsets.iter().enumerate().filter(|(k, _)| *k != constant);
        assert!(others.into_iter().all(|(_, offset)| *offset == Vector3::zeros()));
    }
}
