//! The skin of a rig, learnt from its own frames: taxels that are dead, and those that read a constant force.

mod calibration;
mod layout;
mod offset;
mod reading;
mod silence;

pub use self::calibration::{SkinCalibration, TaxelCalibration};
pub(super) use self::layout::SkinLayout;
use self::offset::OffsetSums;
pub(super) use self::reading::SkinReading;
use self::reading::grasp_weights;
use self::silence::SilenceSums;

/// What taxels have read, of one skin: sums, whose size does not depend on the number of frames.
///
/// All of it is apart from the normal equations of geometry: forces say hardly anything of the poses that visits have found.
#[derive(Clone, Default)]
pub(super) struct SkinEvidence {
    offsets: OffsetSums,
    silence: SilenceSums,
}

impl SkinEvidence {
    /// Adds readings. Those of another number of taxels than the first has are of no skin that is known, and are left out.
    pub(super) fn add(&mut self, readings: &[SkinReading]) {
        let Some(first) = readings.first() else { return };
        let count = if self.offsets.len() > 0 { self.offsets.len() } else { first.forces.len() };
        let readings: Vec<_> = readings.iter().filter(|r| r.forces.len() == count).collect();
        let weights = grasp_weights(&readings);
        for (reading, weight) in readings.iter().zip(&weights) {
            self.offsets.add(reading, *weight);
        }
        // What rings false is told from what is felt first.
        let offsets = self.offsets.solve();
        for (reading, weight) in readings.iter().zip(&weights) {
            let forces: Vec<_> = reading.forces.iter().zip(&offsets).map(|(f, o)| f - o).collect();
            self.silence.add(reading, &forces, *weight);
        }
    }

    /// What that says of the skin; nothing of none.
    pub(super) fn solve(&self) -> SkinCalibration {
        let offsets = self.offsets.solve();
        let dead = self.silence.solve(&offsets);
        let taxel = |(offset, dead)| TaxelCalibration { offset, dead };
        SkinCalibration { taxels: offsets.into_iter().zip(dead).map(taxel).collect() }
    }
}
