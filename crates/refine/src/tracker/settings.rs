//! Settings of a tracker.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use strum::{EnumString, IntoStaticStr, VariantNames};

use super::keyframe::KeyframeSettings;
use crate::error::RefineError;
use crate::search::SearchSettings;
use crate::strategy::{FusedSettings, Stage};

/// What is known of how an object moves from frame to frame; in files, all of it or nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProcessNoise {
    /// Motion that was not foreseen, a random walk in each direction: its variance grows by the square of this in a second \[m/√s\].
    pub translation: f64,
    /// Rotation that was not foreseen, about each axis alike \[rad/√s\].
    pub rotation: f64,
    /// How much of the difference between measured and believed velocity is believed, between 0 and 1.
    pub gain: f64,
}

/// When a pose is not believed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GatingSettings {
    /// The cost may be so many times its running mean,
    pub cost_ratio: f64,
    /// and so much more \[nat\].
    pub cost_margin: f64,
    /// Standard deviations of the prediction that the object may be away from it.
    pub innovation_gate: f64,
    /// Standard deviation of the pose in the direction in which it is largest \[m of surface motion\].
    pub max_sigma: f64,
    /// Share of the pixels that should show an object found again, which do so, at least; half of it where it was expected. Without depth, also of an object
    /// that is followed, as a share of what is usually seen of its colors.
    pub least_shown: f64,
}

impl Default for GatingSettings {
    fn default() -> Self {
        Self {
            cost_ratio: 2.5,
            cost_margin: 40.0,
            innovation_gate: 8.0,
            max_sigma: 12e-3,
            least_shown: 0.5,
        }
    }
}

/// How far a tracker goes to find an object that it has lost. Finding takes far longer than following, and the budget does
/// not hold for it.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    EnumString,
    IntoStaticStr,
    VariantNames,
    Serialize,
    Deserialize,
)]
#[strum(serialize_all = "kebab-case", parse_err_ty = String, parse_err_fn = unknown)]
#[serde(rename_all = "kebab-case")]
pub enum Recovery {
    /// The frame is lost; the next is tried from the prediction.
    Off,
    /// The whole fused estimator from where the object should be.
    Near,
    /// If that fails, a search among all poses.
    Anywhere,
}

impl Recovery {
    /// The name used on the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

fn unknown(text: &str) -> String {
    format!("unknown recovery {text:?}: one of {}", Recovery::VARIANTS.join(", "))
}

/// Settings of [`Tracker`](super::Tracker).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrackerSettings {
    /// Evidence, nuisances and stated accuracies; its stages serve where a pose has to be found.
    pub fused: FusedSettings,
    /// The one stage that follows the object.
    pub stage: Stage,
    /// Motion relative to a hand that is known.
    pub in_hand: ProcessNoise,
    /// Motion in the camera frame, where no hand is known.
    pub free: ProcessNoise,
    /// Time within which what was learnt of calibrations is forgotten, and an object that is not seen comes to rest, all but 1/e \[s\]. Errors that
    /// frames share, such as a warp of depth or a wrong model, count as new in every one of them: the longer they are remembered while nothing
    /// moves, the farther calibrations are led astray.
    pub time_constant: f64,
    /// How far the object has moved by the images.
    pub keyframe: KeyframeSettings,
    /// Poses turned by 10° about the least certain axis of rotation are modes, too, where its standard deviation in
    /// [`Posterior::covariance`](crate::strategy::Posterior::covariance) exceeds this \[rad\]; infinity for never.
    pub turn_sigma: f64,
    /// Time that following may take in a frame; without one it takes what it needs. A step that would not end in time is
    /// not begun, as far as the one before it tells.
    pub budget: Option<Duration>,
    /// When a pose is not believed.
    pub gating: GatingSettings,
    /// What is done then.
    pub recovery: Recovery,
    /// How poses are searched for.
    pub search: SearchSettings,
}

impl Default for TrackerSettings {
    fn default() -> Self {
        Self {
            fused: FusedSettings::default(),
            stage: Stage {
                kernel_scale: 1.0,
                hypotheses: 1,
                measured_noise: false,
                model_error: true,
                ..Stage::octaves(1)
            },
            in_hand: ProcessNoise { translation: 3.7e-3, rotation: 0.037, gain: 0.1 },
            free: ProcessNoise { translation: 0.055, rotation: 0.37, gain: 0.5 },
            time_constant: 0.2,
            keyframe: KeyframeSettings::default(),
            turn_sigma: 0.8f64.to_radians(),
            budget: None,
            gating: GatingSettings::default(),
            recovery: Recovery::Anywhere,
            search: SearchSettings::default(),
        }
    }
}

impl TrackerSettings {
    /// Of an object in a hand that is known, or of one anywhere.
    pub(super) fn motion(&self, in_hand: bool) -> &ProcessNoise {
        if in_hand { &self.in_hand } else { &self.free }
    }

    pub(super) fn check(&self) -> Result<(), RefineError> {
        let positive = [
            ("in_hand.translation", self.in_hand.translation),
            ("in_hand.rotation", self.in_hand.rotation),
            ("free.translation", self.free.translation),
            ("free.rotation", self.free.rotation),
            ("time_constant", self.time_constant),
            ("turn_sigma", self.turn_sigma),
            ("gating.cost_ratio", self.gating.cost_ratio),
            ("gating.cost_margin", self.gating.cost_margin),
            ("gating.innovation_gate", self.gating.innovation_gate),
            ("gating.max_sigma", self.gating.max_sigma),
            ("gating.least_shown", self.gating.least_shown),
        ];
        for (name, value) in positive {
            if value.is_nan() || value <= 0.0 {
                return Err(RefineError::Setting { name, problem: format!("is {value}") });
            }
        }
        if self.time_constant.is_infinite() {
            return Err(RefineError::Setting {
                name: "time_constant",
                problem: "is infinite".into(),
            });
        }
        for (name, gain) in [("in_hand.gain", self.in_hand.gain), ("free.gain", self.free.gain)] {
            if !(0.0..=1.0).contains(&gain) {
                let problem = format!("is {gain}, not between 0 and 1");
                return Err(RefineError::Setting { name, problem });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_named() {
        let mut settings = TrackerSettings::default();
        assert!(settings.check().is_ok());
        settings.time_constant = 0.0;
        assert_eq!(settings.check().unwrap_err().to_string(), "time_constant is 0");
        settings = TrackerSettings::default();
        settings.free.gain = f64::NAN;
        assert!(settings.check().unwrap_err().to_string().contains("free.gain is NaN"));
        assert_eq!("near".parse(), Ok(Recovery::Near));
        assert!("far".parse::<Recovery>().is_err());
    }
}
