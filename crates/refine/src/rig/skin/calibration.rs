//! Calibration of a skin.

use nalgebra::Vector3;

use crate::error::RefineError;
use crate::scene::HandMeasurement;

/// A taxel reads force + offset, or nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct TaxelCalibration {
    /// Constant force that it reads, in the frame of the link: zero but for taxels that ring false \[N\].
    pub offset: Vector3<f64>,
    /// Probability that it is dead.
    pub dead: f64,
}

/// Calibration of all taxels of a hand.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SkinCalibration {
    /// In the order of the hand's taxels; none where nothing is known of them.
    pub taxels: Vec<TaxelCalibration>,
}

/// Forces below that are none \[N\]: noise of a few units, and what is left of an offset.
pub(super) const FELT: f64 = 0.05;

impl TaxelCalibration {
    /// The force \[N\] behind a reading \[N\]; the silence of one that is probably dead says nothing of the force.
    pub fn corrected(&self, reading: &Vector3<f64>) -> Vector3<f64> {
        if self.is_dead() && reading.norm() <= FELT {
            return HandMeasurement::UNKNOWN_FORCE;
        }
        reading - self.offset
    }

    /// Whether it is probably dead.
    pub fn is_dead(&self) -> bool {
        self.dead > 0.5
    }

    /// Whether it rings false.
    pub fn rings_false(&self) -> bool {
        self.offset != Vector3::zeros()
    }
}

impl SkinCalibration {
    /// All numbers of it.
    pub(in crate::rig) fn numbers(&self) -> impl Iterator<Item = f64> {
        let taxel = |t: &TaxelCalibration| {
            let [x, y, z] = t.offset.into();
            [t.dead, x, y, z]
        };
        self.taxels.iter().flat_map(taxel)
    }

    /// Corrects the forces of a hand, if it has a skin.
    ///
    /// # Errors
    /// If that has another number of taxels.
    pub(in crate::rig) fn correct(&self, hand: &mut HandMeasurement) -> Result<(), RefineError> {
        let (given, expected) = (hand.forces.len(), self.taxels.len());
        if given == 0 || expected == 0 {
            return Ok(());
        }
        if given != expected {
            let problem = format!("is of a skin of {expected} taxels, not of {given}");
            return Err(RefineError::Setting { name: "rig", problem });
        }
        for (force, taxel) in hand.forces.iter_mut().zip(&self.taxels) {
            *force = taxel.corrected(force);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::default_scene;

    #[test]
    fn forces_are_corrected_and_the_silence_of_dead_taxels_is_no_silence() {
        let mut hand = default_scene(1).unwrap().observation.hand.unwrap();
        let alive = TaxelCalibration { offset: Vector3::zeros(), dead: 0.1 };
        let mut skin = SkinCalibration { taxels: vec![alive; 368] };
        skin.taxels[3].offset = Vector3::x() * 0.2;
        skin.taxels[4].dead = 0.9;
        skin.taxels[5].dead = 0.9;
        hand.forces[3] = Vector3::new(0.2, 0.0, -1.0);
        hand.forces[4] = Vector3::zeros();
        hand.forces[5] = Vector3::new(0.0, 0.0, -1.0);
        let before = hand.forces.clone();
        skin.correct(&mut hand).unwrap();
        assert_eq!(hand.forces[3], Vector3::new(0.0, 0.0, -1.0));
        assert!(hand.forces[4].iter().all(|f| f.is_nan()));
        assert_eq!((hand.forces[5], hand.forces[6]), (before[5], before[6]));
        hand.forces.pop();
        let refused = skin.correct(&mut hand).unwrap_err().to_string();
        assert!(refused.contains("a skin of 368 taxels, not of 367"), "{refused}");
        hand.forces.clear();
        skin.correct(&mut hand).unwrap();
    }
}
