//! Settings of a tracker.

use std::f64::consts::PI;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use strum::{EnumString, IntoStaticStr, VariantNames};

use super::keyframe::KeyframeSettings;
use super::segmentation::SegmentationSettings;
use crate::defaults::settings;
use crate::error::RefineError;
use crate::search::SearchSettings;
use crate::strategy::{FusedSettings, Stage};

/// Process noise of an object's motion from frame to frame; in files, all of it or nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ProcessNoise {
    /// Intensity of the random walk of the place in each direction: the variance of motion that was not foreseen grows by the square of this in a second
    /// \[m/√s\].
    pub translation: f64,
    /// Intensity of the random walk of the rotation about each axis \[rad/√s\].
    pub rotation: f64,
    /// Gain of the velocity: part of the difference between measured and believed velocity that is believed, between 0 and 1.
    pub gain: f64,
}

settings! {
    /// When a pose is not believed.
    #[derive(Copy)]
    pub struct GatingSettings {
        /// Ratio of the cost to its running mean up to which a pose is believed, but for the margin below.
        pub cost_ratio: f64 = 2.5,
        /// Cost beyond that up to which it is believed, too \[nat\].
        pub cost_margin: f64 = 40.0,
        /// Mahalanobis distance of the object from its prediction up to which it is believed.
        pub innovation_gate: f64 = 8.0,
        /// Standard deviation of the pose in the direction in which it is largest up to which it is believed \[m of surface motion\].
        pub max_sigma: f64 = 12e-3,
        /// Share of the pixels that should show an object found again, which do so, at least; half of it where it was expected. Without depth, also of an object
        /// that is followed, as a share of what is usually seen of its colors.
        pub least_shown: f64 = 0.5,
        /// Growth of the running mean of costs with every frame that the object is lost, as a part of it, because circumstances may have changed for good:
        /// slowly, or what is wrong for a moment would soon pass for right.
        pub growth: f64 = 0.02,
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
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
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

settings! {
    /// Settings of [`Tracker`](super::Tracker).
    pub struct TrackerSettings {
        /// Evidence, nuisances and nominal accuracies; its stages serve where a pose has to be found.
        #[serde(skip)]
        pub fused: FusedSettings = FusedSettings::default(),
        /// Stage that follows the object.
        pub stage: Stage = Stage {
                kernel_scale: 1.0,
                hypotheses: 1,
                measured_noise: false,
                model_error: true,
                ..Stage::octaves(1)
            },
        /// Process noise relative to a hand that is known.
        pub in_hand: ProcessNoise = ProcessNoise { translation: 3.7e-3, rotation: 0.037, gain: 0.1 },
        /// Process noise in the camera frame, where no hand is known.
        pub free: ProcessNoise = ProcessNoise { translation: 0.055, rotation: 0.37, gain: 0.5 },
        /// Time within which what was learnt of calibrations is forgotten, and an object that is not seen comes to rest, all but 1/e \[s\]. Errors that
        /// frames share, such as a warp of depth or a wrong model, count as new in every one of them: the longer they are remembered while nothing moves, the
        /// farther calibrations are led astray. EXPERIMENTS: Time constant of calibrations.
        pub time_constant: f64 = 0.2,
        /// Motion of the object by the images.
        pub keyframe: KeyframeSettings = KeyframeSettings::default(),
        /// Segmentation: which pixels show the object.
        pub segmentation: SegmentationSettings = SegmentationSettings::default(),
        /// Gain of running means of costs, colors and masks: part of the way that they go to the next value.
        pub gain: f64 = 0.1,
        /// Number of frames between two times that colors are learnt or a lost object is looked for, and after which it may be held in another way than
        /// before.
        pub period: u32 = 6,
        /// Rotation from which an object is seen anew, and its other modes are weighed \[rad\].
        pub new_view: f64 = PI / 12.0,
        /// Angle of poses that are turned beside the tracked one \[rad\]; a mode that is nearer to another than half of that is the same.
        pub turn: f64 = PI / 18.0,
        /// Standard deviation of the least certain rotation in [`Posterior::covariance`](crate::strategy::Posterior::covariance) from which poses turned
        /// about its axis are modes, too \[rad\]; infinity for never.
        pub turn_sigma: f64 = 0.8f64.to_radians(),
        /// Time that following may take in a frame; without one it takes what it needs. A step that would not end in time is
        /// not begun, as far as the one before it tells.
        pub budget: Option<Duration> = None,
        /// Gating: when a pose is not believed.
        pub gating: GatingSettings = GatingSettings::default(),
        /// Recovery of an object whose pose is not believed.
        pub recovery: Recovery = Recovery::Anywhere,
        /// Search for poses.
        #[serde(skip)]
        pub search: SearchSettings = SearchSettings::default(),
    }
}

impl TrackerSettings {
    /// Process noise of an object in a hand that is known, or of one anywhere.
    pub(super) fn motion(&self, in_hand: bool) -> &ProcessNoise {
        if in_hand { &self.in_hand } else { &self.free }
    }

    pub(super) fn check(&self) -> Result<(), RefineError> {
        let positive = [
            ("in_hand.translation", self.in_hand.translation),
            ("in_hand.rotation", self.in_hand.rotation),
            ("free.translation", self.free.translation),
            ("free.rotation", self.free.rotation),
            ("turn_sigma", self.turn_sigma),
            ("gating.cost_ratio", self.gating.cost_ratio),
            ("gating.cost_margin", self.gating.cost_margin),
            ("gating.innovation_gate", self.gating.innovation_gate),
            ("gating.max_sigma", self.gating.max_sigma),
            ("gating.least_shown", self.gating.least_shown),
        ];
        RefineError::require_positive(&positive)?;
        RefineError::require_finite(&[("time_constant", self.time_constant)])?;
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
        settings.turn_sigma = f64::INFINITY;
        assert!(settings.check().is_ok());
        settings.time_constant = 0.0;
        assert_eq!(
            settings.check().unwrap_err().to_string(),
            "time_constant is 0, must be finite and above zero"
        );
        settings = TrackerSettings::default();
        settings.free.gain = f64::NAN;
        assert!(settings.check().unwrap_err().to_string().contains("free.gain is NaN"));
        assert_eq!("near".parse(), Ok(Recovery::Near));
        assert!("far".parse::<Recovery>().is_err());
    }
}
