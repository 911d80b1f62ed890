//! All settings of all sensors, by name.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use thiserror::Error;

use super::background::BackgroundSettings;
use super::calibration::CalibrationSettings;
use super::color::ColorSettings;
use super::deformation::ModelSettings;
use super::depth::DepthSettings;
use super::light::LightSettings;
use super::mask::MaskSettings;
use super::touch::TouchSettings;
use super::viewpoint::ViewpointSettings;

/// Settings of all sensor models.
///
/// ```
/// use prehend_refine::synth::SensorSettings;
///
/// let mut sensors = SensorSettings::realistic();
/// sensors.set("depth.scale", "0")?;
/// assert!(sensors.names().contains(&("depth.scale".to_owned(), 0.0)));
/// let unknown = sensors.set("depth.scael", "0").unwrap_err();
/// assert!(unknown.to_string().contains("depth.scale"));
/// # Ok::<(), prehend_refine::synth::SettingError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorSettings {
    /// Where the camera stands.
    pub(in crate::synth) viewpoint: ViewpointSettings,
    /// The light.
    pub(in crate::synth) light: LightSettings,
    /// What is behind the hand.
    pub(in crate::synth) background: BackgroundSettings,
    /// The color images.
    pub(in crate::synth) color: ColorSettings,
    /// The depth images.
    pub(in crate::synth) depth: DepthSettings,
    /// The masks.
    pub(in crate::synth) mask: MaskSettings,
    /// The taxels.
    pub(in crate::synth) touch: TouchSettings,
    /// What is known of camera, hand and joints.
    pub(in crate::synth) calibration: CalibrationSettings,
    /// The object model that the estimator is given.
    pub(in crate::synth) model: ModelSettings,
}

/// Why a setting could not be set.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SettingError {
    /// There is no such setting.
    #[error("there is no sensor setting {key:?}; there are {}", known.join(", "))]
    Unknown {
        /// The name given.
        key: String,
        /// All names.
        known: Vec<String>,
    },
    /// The value is no number of the setting's kind.
    #[error("{key}: {value:?} is not {expected}")]
    Value {
        /// The setting.
        key: String,
        /// The value given.
        value: String,
        /// What it should be.
        expected: &'static str,
    },
}

impl SensorSettings {
    /// Little noise in color and depth; exact calibration and model.
    pub fn clean() -> Self {
        Self {
            viewpoint: ViewpointSettings::preset(),
            light: LightSettings::clean(),
            background: BackgroundSettings::clean(),
            color: ColorSettings::clean(),
            depth: DepthSettings::clean(),
            mask: MaskSettings::clean(),
            touch: TouchSettings::clean(),
            calibration: CalibrationSettings::clean(),
            model: ModelSettings::clean(),
        }
    }

    /// A stereo camera and tactile sensors with realistic faults.
    pub fn realistic() -> Self {
        Self {
            viewpoint: ViewpointSettings::preset(),
            light: LightSettings::realistic(),
            background: BackgroundSettings::realistic(),
            color: ColorSettings::realistic(),
            depth: DepthSettings::realistic(),
            mask: MaskSettings::realistic(),
            touch: TouchSettings::realistic(),
            calibration: CalibrationSettings::realistic(),
            model: ModelSettings::realistic(),
        }
    }

    /// Sets the setting `key`, such as `depth.noise`, to the number `value`.
    ///
    /// # Errors
    /// [`SettingError`]; nothing has changed then.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), SettingError> {
        let mut all = self.to_json();
        let unknown = || {
            let known = self.names().into_iter().map(|(name, _)| name).collect();
            SettingError::Unknown { key: key.to_owned(), known }
        };
        let (group, name) = key.split_once('.').ok_or_else(unknown)?;
        let group = if group == "colour" { "color" } else { group };
        let slot = all.get_mut(group).and_then(|g| g.get_mut(name)).ok_or_else(unknown)?;
        let wrong = |expected| SettingError::Value {
            key: key.to_owned(),
            value: value.to_owned(),
            expected,
        };
        if slot.is_u64() {
            let number: u32 = value.parse().map_err(|_| wrong("a whole number of at least 0"))?;
            *slot = Value::from(number);
        } else {
            let number: f64 = value.parse().map_err(|_| wrong("a number"))?;
            let share = name.ends_with("_share");
            if !(number.is_finite() && number >= 0.0) {
                return Err(wrong("a finite number of at least 0"));
            }
            if share && number > 1.0 {
                return Err(wrong("a share between 0 and 1"));
            }
            *slot = Value::from(number);
        }
        *self = serde_json::from_value(all).map_err(|_| wrong("within the setting's range"))?;
        Ok(())
    }

    /// Every setting's name, such as `depth.noise`, with its value.
    pub fn names(&self) -> Vec<(String, f64)> {
        let mut names = Vec::new();
        for (group, settings) in self.to_json().as_object().into_iter().flatten() {
            for (name, value) in settings.as_object().into_iter().flatten() {
                names.push((format!("{group}.{name}"), value.as_f64().unwrap_or(f64::NAN)));
            }
        }
        names
    }

    /// The settings as JSON, one object a group.
    pub(in crate::synth) fn to_json(&self) -> Value {
        // Numbers under names: nothing that JSON lacks.
        serde_json::to_value(self).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_setting_can_be_set_by_its_name() {
        let mut settings = SensorSettings::realistic();
        let names = settings.names();
        assert!(names.len() > 40 && names.iter().all(|(_, v)| v.is_finite()));
        for (name, _) in &names {
            settings.set(name, "1").unwrap();
        }
        assert!(settings.names().iter().all(|(_, v)| *v == 1.0));
        settings.set("colour.blur", "2").unwrap();
        assert_eq!(settings.color.blur, 2.0);
    }

    #[test]
    fn wrong_names_and_values_are_refused_and_change_nothing() {
        let mut settings = SensorSettings::clean();
        for (key, value, said) in [
            ("noise", "1", "no sensor setting \"noise\"; there are background."),
            ("depth.nose", "1", "depth.noise"),
            ("depth.noise", "little", "depth.noise: \"little\" is not a number"),
            ("depth.noise", "-1", "at least 0"),
            ("depth.noise", "nan", "finite"),
            ("depth.hole_share", "1.5", "a share between 0 and 1"),
            ("light.lamps", "1.5", "a whole number"),
            ("color.jpeg_quality", "300", "within the setting's range"),
        ] {
            let error = settings.set(key, value).unwrap_err().to_string();
            assert!(error.contains(said), "{key}={value}: {error}");
        }
        assert_eq!(settings, SensorSettings::clean());
    }
}
