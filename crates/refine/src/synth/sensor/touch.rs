//! Tactile sensors and their faults.

use nalgebra::Vector3;
use prehend_geometry::SplitMix64;

use super::settings::TouchSettings;
use crate::data::bop::Tactile;

impl TouchSettings {
    /// Conditions of `count` taxels through a grasp.
    pub(super) fn condition(&self, count: usize, noise: &mut SplitMix64) -> Vec<TaxelCondition> {
        let one = |_| {
            let (fate, gain) = (noise.uniform(), 1.0 + self.gain * (2.0 * noise.uniform() - 1.0));
            let direction = Vector3::new(noise.normal(), noise.normal(), noise.normal());
            let size = -self.false_force * (1.0 - noise.uniform()).ln();
            let wrong = fate >= self.dead_share && fate < self.dead_share + self.false_share;
            TaxelCondition {
                gain: if fate < self.dead_share { 0.0 } else { gain },
                phantom: match direction.try_normalize(1e-12) {
                    Some(direction) if wrong => direction * size,
                    _ => Vector3::zeros(),
                },
            }
        };
        (0..count).map(one).collect()
    }

    /// Readings \[N\] of taxels that bear `forces` \[N\].
    pub(super) fn simulate_taxels(
        &self,
        forces: &[Vector3<f64>],
        condition: &[TaxelCondition],
        noise: &mut SplitMix64,
    ) -> Vec<Vector3<f64>> {
        let read = |(force, taxel): (&Vector3<f64>, &TaxelCondition)| {
            let jitter = Vector3::from_fn(|_, _| self.noise * noise.normal());
            if taxel.gain == 0.0 {
                return Vector3::zeros();
            }
            let felt = force * (taxel.gain * Tactile::UNITS_PER_NEWTON) + taxel.phantom + jitter;
            if felt.norm() < self.threshold {
                return Vector3::zeros();
            }
            let limit = if self.limit > 0.0 { self.limit } else { f64::INFINITY };
            let step = |v: f64| {
                if self.quantum > 0.0 { (v / self.quantum).round() * self.quantum } else { v }
            };
            // Adding zero makes the negative zero a positive one.
            felt.map(|v| step(v).clamp(-limit, limit) / Tactile::UNITS_PER_NEWTON + 0.0)
        };
        forces.iter().zip(condition).map(read).collect()
    }
}

/// Errors of one taxel that stay the same through a grasp.
#[derive(Clone, Debug)]
pub(super) struct TaxelCondition {
    /// Zero for a dead one.
    pub(super) gain: f64,
    /// Felt without cause \[units\].
    pub(super) phantom: Vector3<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::sensor::settings::SensorSettings;

    fn readings(settings: &TouchSettings, force: f64) -> Vec<Vector3<f64>> {
        let mut noise = SplitMix64::new(12);
        let forces = vec![Vector3::z() * force; 5000];
        let condition = settings.condition(forces.len(), &mut noise);
        settings.simulate_taxels(&forces, &condition, &mut noise)
    }

    #[test]
    fn clean_skin_reads_the_force_to_a_unit_and_clips_it() {
        let all = readings(&SensorSettings::clean().touch, -0.3504);
        assert!(all.iter().all(|f| (f - Vector3::new(0.0, 0.0, -0.35)).norm() < 1e-12));
        let strong = readings(&SensorSettings::clean().touch, 12.0);
        assert!(strong.iter().all(|f| f.z == 10.0));
    }

    #[test]
    fn shares_of_dead_and_false_taxels_are_as_asked_for() {
        let settings = SensorSettings::realistic().touch;
        let touched = readings(&settings, 1.0);
        let dead = touched.iter().filter(|f| f.norm() == 0.0).count() as f64 / 5000.0;
        assert!((dead - 0.1).abs() < 0.015, "{dead}");
        let quiet = readings(&settings, 0.0);
        let wrong = quiet.iter().filter(|f| f.norm() > 0.0).count() as f64 / 5000.0;
        assert!((0.02..0.04).contains(&wrong), "{wrong}");
        let gains: Vec<f64> = touched.iter().map(|f| f.z).filter(|z| *z > 0.0).collect();
        let inside = gains.iter().filter(|g| (0.72..1.28).contains(*g)).count();
        assert!(inside as f64 > 0.95 * gains.len() as f64);
        assert!(gains.iter().any(|g| *g < 0.8) && gains.iter().any(|g| *g > 1.2));
        for f in touched.iter().chain(&quiet) {
            assert!(f.iter().all(|v| (v * 100.0 - (v * 100.0).round()).abs() < 1e-9));
        }
    }
}
