//! What is wrong with a skin.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::error::RefineError;
use crate::scene::{HandMeasurement, Inertial};

/// A taxel reads gain · force + offset, or nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct TaxelCalibration {
    /// What forces are multiplied by.
    pub gain: f64,
    /// Its standard deviation.
    pub gain_sigma: f64,
    /// What is added then, in the frame of the link: zero but for taxels that ring false \[N\].
    pub offset: Vector3<f64>,
    /// Probability that it is dead.
    pub dead: f64,
}

/// The mass of an object, as touch has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectMass {
    /// Mass \[kg\].
    pub mass: f64,
    /// Its standard deviation \[kg\].
    pub sigma: f64,
}

/// A skin, and what it says of masses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SkinCalibration {
    /// In the order of the hand's taxels; none where nothing is known of them.
    pub taxels: Vec<TaxelCalibration>,
    /// By the object's number.
    pub masses: BTreeMap<u32, ObjectMass>,
}

/// Forces below that are none \[N\]: noise of a few units, and what is left of an offset.
pub(super) const FELT: f64 = 0.05;

/// Standard deviation of a gain before anything is known of it.
pub(super) const GAIN_SIGMA: f64 = 0.15;

impl TaxelCalibration {
    /// The force \[N\] behind a reading \[N\]; the silence of one that is probably dead says nothing of the force.
    pub fn corrected(&self, reading: &Vector3<f64>) -> Vector3<f64> {
        if self.is_dead() && reading.norm() <= FELT {
            return HandMeasurement::UNKNOWN_FORCE;
        }
        (reading - self.offset) / self.gain
    }

    /// Whether it is probably dead.
    pub fn is_dead(&self) -> bool {
        self.dead > 0.5
    }

    /// Whether it rings false.
    pub fn rings_false(&self) -> bool {
        self.offset != Vector3::zeros()
    }

    /// Whether its gain is known better than beforehand.
    pub fn has_known_gain(&self) -> bool {
        self.gain_sigma < 0.8 * GAIN_SIGMA
    }
}

impl SkinCalibration {
    /// All numbers of it.
    pub(in crate::rig) fn numbers(&self) -> impl Iterator<Item = f64> {
        let taxel = |t: &TaxelCalibration| {
            let [x, y, z] = t.offset.into();
            [t.gain, t.gain_sigma, t.dead, x, y, z]
        };
        let masses = self.masses.values().flat_map(|told| [told.mass, told.sigma]);
        self.taxels.iter().flat_map(taxel).chain(masses)
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

    /// `given`, of object `id`, with the mass that touch tells.
    pub(in crate::rig) fn inertial(&self, id: u32, given: &Inertial) -> Inertial {
        let Some(ObjectMass { mass, .. }) = self.masses.get(&id) else { return given.clone() };
        let inertia = given.inertia * (mass / given.mass);
        Inertial { mass: *mass, inertia, ..given.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::default_scene;

    #[test]
    fn a_mass_that_touch_tells_scales_inertia() {
        let given = default_scene(1).unwrap().object.inertial.clone();
        let told = ObjectMass { mass: 2.0 * given.mass, sigma: 0.1 };
        let skin = SkinCalibration { masses: BTreeMap::from([(5, told)]), ..Default::default() };
        assert_eq!(skin.inertial(6, &given), given);
        let Inertial { mass, center_of_mass, inertia } = skin.inertial(5, &given);
        assert_eq!((mass, center_of_mass), (told.mass, given.center_of_mass));
        assert!((inertia - given.inertia * 2.0).norm() < 1e-12 * inertia.norm());
    }

    #[test]
    fn forces_are_corrected_and_the_silence_of_dead_taxels_is_no_silence() {
        let mut hand = default_scene(1).unwrap().observation.hand.unwrap();
        let alive =
            TaxelCalibration { gain: 1.0, gain_sigma: 0.15, offset: Vector3::zeros(), dead: 0.1 };
        let mut skin = SkinCalibration { taxels: vec![alive.clone(); 368], ..Default::default() };
        skin.taxels[3] =
            TaxelCalibration { gain: 0.5, offset: Vector3::x() * 0.2, ..alive.clone() };
        skin.taxels[4].dead = 0.9;
        skin.taxels[5].dead = 0.9;
        hand.forces[3] = Vector3::new(0.2, 0.0, -1.0);
        hand.forces[4] = Vector3::zeros();
        hand.forces[5] = Vector3::new(0.0, 0.0, -1.0);
        let before = hand.forces.clone();
        skin.correct(&mut hand).unwrap();
        assert_eq!(hand.forces[3], Vector3::new(0.0, 0.0, -2.0));
        assert!(hand.forces[4].iter().all(|f| f.is_nan()));
        assert_eq!((hand.forces[5], hand.forces[6]), (before[5], before[6]));
        hand.forces.pop();
        let refused = skin.correct(&mut hand).unwrap_err().to_string();
        assert!(refused.contains("a skin of 368 taxels, not of 367"), "{refused}");
        hand.forces.clear();
        skin.correct(&mut hand).unwrap();
    }
}
