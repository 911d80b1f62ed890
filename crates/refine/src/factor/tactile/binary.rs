//! Touch without forces: places of the skin that are touched, and others that are not.

use super::probe::{Distance, Probe};
use super::{ProximitySettings, TactileFactor, TactileSettings};
use crate::defaults::settings;
use crate::error::RefineError;
use crate::problem::NoiseModel;
use crate::scene::{BinaryContact, PreparedFrame, TouchReading};

settings! {
    /// Settings of [`TactileFactor::binary`].
    pub struct BinaryTouchSettings {
        /// Noise of distances of touched places from the surface \[m\]: coarser than of forces, which tell where between taxels a contact is.
        pub contact: NoiseModel =
            NoiseModel::cauchy(2.5e-3, ProximitySettings::default().noise.effective_samples),
        /// Noise of depths of other places inside the object \[m\].
        pub no_contact: NoiseModel = TactileSettings::default().no_contact,
    }
}

impl TactileFactor {
    /// Factor `binary-touch` of all sensors of `frame` that tell contact alone ([`TouchReading::Binary`]): touched places are on the surface, with
    /// `touched`; others are not inside, with `untouched`.
    ///
    /// # Errors
    /// If the hand is unknown.
    pub fn binary(
        frame: &PreparedFrame<'_>,
        settings: &BinaryTouchSettings,
        [touched, untouched]: [bool; 2],
    ) -> Result<Self, RefineError> {
        Self::of_hand("binary-touch", frame, |measured| {
            let readings = measured.touch.iter().filter_map(|reading| match reading {
                TouchReading::Binary(contacts) => Some(contacts),
                _ => None,
            });
            let contacts: Vec<&BinaryContact> = readings.flatten().collect();
            let count = |touched: bool| contacts.iter().filter(|c| c.touched == touched).count();
            let contact = settings.contact.weighting(count(true));
            let no_contact = settings.no_contact.weighting(count(false));
            let used = contacts.iter().filter(|c| if c.touched { touched } else { untouched });
            let probe = |&&BinaryContact { link, position, touched }: &&BinaryContact| {
                let (distance, weighting) = match touched {
                    true => (Distance::Is(0.0), contact),
                    false => (Distance::Outside, no_contact),
                };
                Probe { link, position, distance, weighting }
            };
            Ok(used.map(probe).collect())
        })
    }
}
