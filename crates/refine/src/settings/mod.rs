//! All settings, as one TOML file has them.

#[cfg(feature = "cli")]
mod document;

use std::error::Error;
use std::path::Path;

use prehend_geometry::limits::MAX_TEXT_BYTES;
use prehend_geometry::read_plain;
#[cfg(feature = "cli")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::calibration::CalibratorSettings;
use crate::error::SettingsError;
use crate::network::NetworkSettings;
use crate::search::SearchSettings;
use crate::strategy::FusedSettings;
use crate::tracker::TrackerSettings;

/// Settings of estimator, search, networks, tracker and calibration: what the command's `--settings FILE` and `--set PATH=VALUE` change, and Python's `settings`.
///
/// Settings that a file leaves out keep their values: each table of it is merged into that of the defaults; an array replaces the whole array.
///
/// ```
/// use prehend_refine::Settings;
///
/// let mut settings = Settings::from_toml("[estimator.patches]\nsigma = 7e-4\n")?;
/// settings.set("tracker.gating.max_sigma", "0.02")?;
/// assert_eq!(settings.tracker().gating.max_sigma, 0.02);
/// # Ok::<(), prehend_refine::SettingsError>(())
/// ```
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// The fused estimator: refinement, and in it what search, tracker and calibration solve.
    pub estimator: FusedSettings,
    /// The search for poses from sensors alone.
    pub search: SearchSettings,
    /// Networks that propose poses ([`PoseNetwork::with_settings`](crate::network::PoseNetwork::with_settings)).
    pub network: NetworkSettings,
    /// The tracker.
    pub tracker: TrackerSettings,
    /// The calibration of a rig from its frames.
    pub calibration: CalibratorSettings,
}

impl Settings {
    /// The defaults, but for what the TOML document `text` has.
    ///
    /// # Errors
    /// If it is no TOML, has settings that there are not, or values that they cannot have.
    pub fn from_toml(text: &str) -> Result<Self, SettingsError> {
        let changes = text.parse().map_err(|error: toml::de::Error| {
            let before = error.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
            let line = before.matches('\n').count() + 1;
            SettingsError::value(format!("line {line}"), error.message().replace('\n', ", "))
        })?;
        Self::default().changed(Value::Table(changes))
    }

    /// [`from_toml`](Self::from_toml) of a file.
    ///
    /// # Errors
    /// See there; and if it cannot be read.
    pub fn load(file: &Path) -> Result<Self, SettingsError> {
        let read = || -> Result<Self, Box<dyn Error + Send + Sync>> {
            let text = String::from_utf8(read_plain(file, MAX_TEXT_BYTES)?)?;
            Ok(Self::from_toml(&text)?)
        };
        read().map_err(|source| SettingsError::File { file: file.to_owned(), source })
    }

    /// Changes the setting at `path`, names and indices of arrays from 0 with dots between, such as `estimator.stages.3.points`; `value` is as TOML has
    /// it, and text also without quotation marks.
    ///
    /// # Errors
    /// If there is no such setting, or it cannot have this value.
    pub fn set(&mut self, path: &str, value: &str) -> Result<(), SettingsError> {
        let table = format!("value = {value}").parse::<Table>().ok();
        let value = table.and_then(|mut table| table.remove("value")).unwrap_or(value.into());
        let nested = |value, name: &str| Table::from_iter([(name.to_owned(), value)]).into();
        *self = self.changed(path.rsplit('.').fold(value, nested))?;
        Ok(())
    }

    /// These settings as a TOML document, for [`from_toml`](Self::from_toml).
    ///
    /// # Errors
    /// If a number is larger than TOML has them.
    pub fn to_toml(&self) -> Result<String, SettingsError> {
        toml::to_string(self).map_err(|error| SettingsError::value("settings", error))
    }

    /// With the values that `changes` have.
    fn changed(&self, changes: Value) -> Result<Self, SettingsError> {
        let mut all =
            Value::try_from(self).map_err(|error| SettingsError::value("settings", error))?;
        require_sizes("", &changes)?;
        merge(&mut all, changes);
        serde_path_to_error::deserialize(all).map_err(|error| {
            SettingsError::value(error.path().to_string(), error.inner().message())
        })
    }

    /// Settings of the search, with those of the estimator whose factors it uses.
    pub fn search(&self) -> SearchSettings {
        SearchSettings { estimator: self.estimator.clone(), ..self.search.clone() }
    }

    /// Settings of the tracker, with those of the estimator and the search in it.
    pub fn tracker(&self) -> TrackerSettings {
        let (fused, search) = (self.estimator.clone(), self.search());
        TrackerSettings { fused, search, ..self.tracker.clone() }
    }

    /// Settings of the calibration, with those of the estimator that refines its frames.
    pub fn calibration(&self) -> CalibratorSettings {
        CalibratorSettings { fused: self.estimator.clone(), ..self.calibration.clone() }
    }
}

/// Puts `changes` in place of what `values` have: tables are merged, and elements of an array have their indices for names.
pub(crate) fn merge(values: &mut Value, changes: Value) {
    match (values, changes) {
        (Value::Table(values), Value::Table(changes)) => {
            for (name, change) in changes {
                match values.get_mut(&name) {
                    Some(value) => merge(value, change),
                    None => drop(values.insert(name, change)),
                }
            }
        }
        (Value::Array(values), Value::Table(changes))
            if changes.keys().all(|k| k.parse().is_ok_and(|k: usize| k < values.len())) =>
        {
            for (name, change) in changes {
                let value = name.parse().ok().and_then(|k: usize| values.get_mut(k));
                value.into_iter().for_each(|value| merge(value, change.clone()));
            }
        }
        (value, change) => *value = change,
    }
}

/// Refuses numbers that are none, or negative: all settings are sizes of something.
fn require_sizes(path: &str, value: &Value) -> Result<(), SettingsError> {
    let join = |name: &str| if path.is_empty() { name.into() } else { format!("{path}.{name}") };
    let is_wrong = match value {
        Value::Table(table) => {
            return table.iter().try_for_each(|(name, value)| require_sizes(&join(name), value));
        }
        Value::Array(values) => {
            let mut values = values.iter().enumerate();
            return values.try_for_each(|(k, value)| require_sizes(&join(&k.to_string()), value));
        }
        Value::Float(number) => number.is_nan() || number.is_sign_negative(),
        Value::Integer(number) => *number < 0,
        _ => false,
    };
    match is_wrong {
        true => Err(SettingsError::value(path, format!("{value} is not a number from zero on"))),
        false => Ok(()),
    }
}
