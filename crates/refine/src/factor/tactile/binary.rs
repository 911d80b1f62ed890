//! Touch without forces: places of the skin that are touched, and others that are not.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::probes::{Distance, Probe, Probes};
use super::{ProximitySettings, TactileSettings};
use crate::error::RefineError;
use crate::problem::{Factor, NoiseModel, Rows, State};
use crate::scene::{BinaryContact, PreparedFrame, TouchReading};

/// Settings of [`BinaryTouchFactor`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct BinaryTouchSettings {
    /// Noise of distances of touched places from the surface \[m\]: coarser than of forces, which tell where between taxels a contact is.
    pub contact: NoiseModel,
    /// Noise of depths of other places inside the object \[m\].
    pub no_contact: NoiseModel,
}

impl Default for BinaryTouchSettings {
    fn default() -> Self {
        let TactileSettings { no_contact, .. } = TactileSettings::default();
        let samples = ProximitySettings::default().noise.effective_samples;
        Self { contact: NoiseModel::cauchy(2.5e-3, samples), no_contact }
    }
}

impl BinaryTouchSettings {
    /// With kernels `factor` times as wide.
    pub(crate) fn widened(self, factor: f64) -> Self {
        let [contact, no_contact] = [self.contact, self.no_contact].map(|n| n.widened(factor));
        Self { contact, no_contact }
    }
}

/// Places that are touched are on the surface, others are not inside ([`TouchReading::Binary`]).
pub struct BinaryTouchFactor(Probes);

impl BinaryTouchFactor {
    /// Of all sensors of `frame` that tell contact alone: touched places with `touched`, others with `untouched`.
    ///
    /// # Errors
    /// If the hand is unknown.
    pub fn new(
        frame: &PreparedFrame<'_>,
        settings: &BinaryTouchSettings,
        [touched, untouched]: [bool; 2],
    ) -> Result<Self, RefineError> {
        let measured = frame.require_hand("binary-touch")?;
        let hand = &measured.hand;
        let readings = measured.touch.iter().filter_map(|reading| match reading {
            TouchReading::Binary(contacts) => Some(contacts),
            _ => None,
        });
        let contacts: Vec<BinaryContact> = readings.flatten().copied().collect();
        let count = |touched: bool| contacts.iter().filter(|c| c.touched == touched).count();
        let contact = settings.contact.weighting(count(true));
        let no_contact = settings.no_contact.weighting(count(false));
        let used = contacts.iter().filter(|c| if c.touched { touched } else { untouched });
        let probe = |&BinaryContact { link, position, touched }: &BinaryContact| {
            let (distance, weighting) = match touched {
                true => (Distance::Is(0.0), contact),
                false => (Distance::Outside, no_contact),
            };
            Probe { link, position, distance, weighting }
        };
        let probes = used.map(probe).collect();
        let (object, hand) = (Arc::clone(frame.object()), Arc::clone(hand));
        Ok(Self(Probes { object, hand, probes }))
    }
}

impl Factor for BinaryTouchFactor {
    fn name(&self) -> &'static str {
        "binary-touch"
    }

    fn rows(&self, state: &State, rows: &mut Rows<'_>) {
        self.0.rows(state, rows);
    }
}
