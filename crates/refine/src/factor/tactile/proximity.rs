//! Proximity: how far the object is from places of the skin.

use super::TactileFactor;
use super::probe::{Distance, Probe};
use crate::defaults::settings;
use crate::error::RefineError;
use crate::problem::NoiseModel;
use crate::scene::{PreparedFrame, ProximityReading, TouchReading};

settings! {
    /// Settings of [`TactileFactor::proximity`].
    pub struct ProximitySettings {
        /// Noise of short distances \[m\]; neighbors are off alike, by the skin and the object's model.
        pub noise: NoiseModel = NoiseModel::cauchy(1e-3, 10.0),
        /// Standard deviation of long ones, as a part of the distance.
        pub relative: f64 = 0.05,
    }
}

impl TactileFactor {
    /// Factor `proximity`: places of the skin are as far from the object's surface as all proximity sensors of `frame` say ([`TouchReading::Proximity`]).
    ///
    /// # Errors
    /// If the hand is unknown.
    pub fn proximity(
        frame: &PreparedFrame<'_>,
        settings: &ProximitySettings,
    ) -> Result<Self, RefineError> {
        Self::of_hand("proximity", frame, |measured| {
            let readings = measured.touch.iter().filter_map(|reading| match reading {
                TouchReading::Proximity(readings) => Some(readings),
                _ => None,
            });
            let readings: Vec<&ProximityReading> = readings.flatten().collect();
            let probe = |&&ProximityReading { link, position, distance }: &&ProximityReading| {
                let sigma = settings.noise.sigma.hypot(settings.relative * distance);
                let weighting = settings.noise.with_sigma(sigma).weighting(readings.len());
                Probe { link, position, distance: Distance::Is(distance), weighting }
            };
            Ok(readings.iter().map(probe).collect())
        })
    }
}
