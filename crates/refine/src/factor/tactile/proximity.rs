//! Proximity: how far the object is from places of the skin.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::probes::{Distance, Probe, Probes};
use crate::error::RefineError;
use crate::problem::{Factor, NoiseModel, Rows, State};
use crate::scene::{PreparedFrame, ProximityReading, TouchReading};

/// Settings of [`ProximityFactor`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ProximitySettings {
    /// Noise of short distances \[m\]; neighbors are off alike, by the skin and the object's model.
    pub noise: NoiseModel,
    /// Standard deviation of long ones, as a part of the distance.
    pub relative: f64,
}

impl Default for ProximitySettings {
    fn default() -> Self {
        // Neighbors are off alike, by the skin and the object's model.
        Self { noise: NoiseModel::cauchy(1e-3, 10.0), relative: 0.05 }
    }
}

impl ProximitySettings {
    /// With a kernel `factor` times as wide.
    pub(crate) fn widened(self, factor: f64) -> Self {
        Self { noise: self.noise.widened(factor), ..self }
    }
}

/// Places of the skin are as far from the object's surface as they say ([`TouchReading::Proximity`]).
pub struct ProximityFactor(Probes);

impl ProximityFactor {
    /// Of all proximity sensors of `frame`.
    ///
    /// # Errors
    /// If the hand is unknown.
    pub fn new(
        frame: &PreparedFrame<'_>,
        settings: &ProximitySettings,
    ) -> Result<Self, RefineError> {
        let measured = frame.require_hand("proximity")?;
        let hand = &measured.hand;
        let readings = measured.touch.iter().filter_map(|reading| match reading {
            TouchReading::Proximity(readings) => Some(readings),
            _ => None,
        });
        let readings: Vec<ProximityReading> = readings.flatten().copied().collect();
        let probe = |&ProximityReading { link, position, distance }: &ProximityReading| {
            let sigma = settings.noise.sigma.hypot(settings.relative * distance);
            let weighting = settings.noise.with_sigma(sigma).weighting(readings.len());
            Probe { link, position, distance: Distance::Is(distance), weighting }
        };
        let probes = readings.iter().map(probe).collect();
        let (object, hand) = (Arc::clone(frame.object()), Arc::clone(hand));
        Ok(Self(Probes { object, hand, probes }))
    }
}

impl Factor for ProximityFactor {
    fn name(&self) -> &'static str {
        "proximity"
    }

    fn rows(&self, state: &State, rows: &mut Rows<'_>) {
        self.0.rows(state, rows);
    }
}
