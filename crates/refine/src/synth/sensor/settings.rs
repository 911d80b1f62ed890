//! All settings of all sensors, by name, with their values in all presets.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use thiserror::Error;

/// Makes a structure of each group of settings, and [`SensorSettings`] of the groups.
macro_rules! sensor_settings {
    ($($(#[$about:meta])* $group:ident: $Group:ident {
        $($(#[$what:meta])* $name:ident: $number:ty { clean: $clean:expr, realistic: $real:expr $(, rig: $rig:expr)? },)*
    })*) => {
        $(
            $(#[$about])*
            #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
            #[serde(deny_unknown_fields)]
            pub(in crate::synth) struct $Group {
                $($(#[$what])* pub(in crate::synth) $name: $number,)*
            }
        )*

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
        /// # Ok::<(), Box<dyn std::error::Error>>(())
        /// ```
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct SensorSettings {
            $($(#[$about])* pub(in crate::synth) $group: $Group,)*
        }

        impl SensorSettings {
            /// Little noise in color and depth; exact calibration and model.
            pub fn clean() -> Self {
                Self { $($group: $Group { $($name: $clean),* }),* }
            }

            /// A stereo camera and tactile sensors with realistic faults.
            pub fn realistic() -> Self {
                Self { $($group: $Group { $($name: $real),* }),* }
            }

            /// The same of one rig: what is wrong with cameras, hand and skin is so in every frame.
            pub fn rig() -> Self {
                let mut settings = Self::realistic();
                $($($(settings.$group.$name = $rig;)?)*)*
                settings
            }
        }
    };
}

sensor_settings! {
    /// Where cameras stand about the hand.
    viewpoint: ViewpointSettings {
        /// Nearest distance from the object's center \[m\].
        nearest: f64 { clean: 0.4, realistic: 0.4 },
        /// Farthest distance \[m\].
        farthest: f64 { clean: 0.6, realistic: 0.6 },
        /// Focal length, as a share of the image's width.
        focal_width_ratio: f64 { clean: 0.906, realistic: 0.906 },
        /// Standard deviation of where the camera aims, per axis \[m\].
        aim: f64 { clean: 0.015, realistic: 0.015 },
        /// Standard deviation of the angle between the image's vertical and the world's \[deg\].
        roll_deg: f64 { clean: 8.0, realistic: 8.0 },
        /// Largest share of the object that the hand may hide, where a view with less can be found.
        hidden_share: f64 { clean: 0.55, realistic: 0.55 },
    }
    /// What lights the scene.
    light: LightSettings {
        /// Lamps beside the light from everywhere; the first is the strongest.
        lamps: u32 { clean: 2, realistic: 3 },
        /// Share of the light that comes from everywhere.
        ambient_share: f64 { clean: 0.5, realistic: 0.4 },
        /// Standard deviation of a lamp's color per channel.
        tint: f64 { clean: 0.03, realistic: 0.08 },
        /// Strength of the highlights.
        gloss: f64 { clean: 0.0, realistic: 0.12 },
        /// Share of the first lamp's light that its shadow takes away.
        shadow_share: f64 { clean: 0.0, realistic: 0.7 },
    }
    /// The room behind the hand.
    background: BackgroundSettings {
        /// Mean distance of the wall \[m\].
        distance: f64 { clean: 1.4, realistic: 1.4 },
        /// Standard deviation of the wall's slopes.
        slope: f64 { clean: 0.1, realistic: 0.3 },
        /// Things in front of the wall, at most.
        things: u32 { clean: 0, realistic: 14 },
        /// Standard deviation of the wall's pattern per channel.
        pattern: f64 { clean: 0.0, realistic: 0.04 },
    }
    /// Faults of the color images. Zero takes any of them away.
    color: ColorSettings {
        /// Standard deviation of the exposure \[stops\].
        exposure: f64 { clean: 0.0, realistic: 0.35 },
        /// Standard deviation of the gain of each channel.
        white_balance: f64 { clean: 0.0, realistic: 0.06 },
        /// Standard deviation of the blur \[px\], at most.
        blur: f64 { clean: 0.0, realistic: 1.0 },
        /// Standard deviation of the noise of each channel in the dark.
        noise: f64 { clean: 0.01, realistic: 0.01 },
        /// Variance that noise gains with brightness, up to white.
        shot_noise: f64 { clean: 0.0, realistic: 2e-4 },
        /// Quality of the JPEG files, 1 to 100; 0 for PNG, which loses nothing.
        jpeg_quality: u8 { clean: 0, realistic: 88 },
    }
    /// Faults of the depth images. Zero takes any of them away.
    depth: DepthSettings {
        /// Standard deviation of the scale error, the same through a grasp.
        scale: f64 { clean: 0.0, realistic: 4e-3, rig: 6e-3 },
        /// Standard deviation of a smooth warp that changes over a third of the image, the same through a grasp \[m\].
        warp: f64 { clean: 0.0, realistic: 1.5e-3 },
        /// Standard deviation of noise of single pixels, at half a meter; it grows with the square of the depth \[m\].
        noise: f64 { clean: 7e-4, realistic: 3e-4 },
        /// Standard deviation of noise with a correlation over `correlation` pixels, at half a meter \[m\].
        correlated_noise: f64 { clean: 0.0, realistic: 8e-4 },
        /// Reach of the correlated noise \[px\].
        correlation: f64 { clean: 3.0, realistic: 3.0 },
        /// Steps of the disparity \[px\].
        disparity_step: f64 { clean: 0.0, realistic: 0.1 },
        /// Distance of the two eyes \[m\]: with the focal length it makes disparity of depth, and what only one of them sees has
        /// none.
        baseline: f64 { clean: 0.0, realistic: 0.05 },
        /// How far what is near spreads over what is behind it \[px\], at most.
        fattening: f64 { clean: 0.0, realistic: 2.0 },
        /// Share of the pixels at edges whose depth lies between that of both sides.
        flying_share: f64 { clean: 0.0, realistic: 0.35 },
        /// Share of the pixels that are lost in patches.
        hole_share: f64 { clean: 0.0, realistic: 0.02 },
        /// Angle of sight to surface below which half of the pixels are lost \[deg\].
        grazing_deg: f64 { clean: 0.0, realistic: 12.0 },
    }
    /// Faults of the masks. Zero takes any of them away.
    mask: MaskSettings {
        /// Standard deviation of the outline's place \[px\].
        wobble: f64 { clean: 0.0, realistic: 1.2 },
        /// Length along the outline over which it wobbles \[px\].
        wobble_length: f64 { clean: 12.0, realistic: 12.0 },
        /// How far the mask leaks onto the hand where it does \[px\].
        leak: f64 { clean: 0.0, realistic: 5.0 },
        /// Share of the border with the hand where it leaks.
        leak_share: f64 { clean: 0.0, realistic: 0.25 },
    }
    /// Faults of the taxels. Forces are in sensor units, 1000 a newton.
    touch: TouchSettings {
        /// Share of the taxels that say nothing, the same ones through a grasp.
        dead_share: f64 { clean: 0.0, realistic: 0.1 },
        /// Share of the taxels that feel what is not there, the same ones through a grasp.
        false_share: f64 { clean: 0.0, realistic: 0.03 },
        /// Mean size of what those feel \[units\].
        false_force: f64 { clean: 0.0, realistic: 250.0 },
        /// Largest error of a taxel's gain, uniform, the same through a grasp.
        gain: f64 { clean: 0.0, realistic: 0.25 },
        /// Standard deviation of the noise of each axis \[units\].
        noise: f64 { clean: 0.0, realistic: 8.0 },
        /// Forces smaller than this read as none \[units\].
        threshold: f64 { clean: 0.0, realistic: 30.0 },
        /// Step of the readings \[units\].
        quantum: f64 { clean: 1.0, realistic: 10.0 },
        /// Largest reading of an axis \[units\].
        limit: f64 { clean: 10_000.0, realistic: 10_000.0 },
    }
    /// Standard deviations of the calibration's errors, which stay the same through a grasp.
    calibration: CalibrationSettings {
        /// 1 if all that stays the same through a grasp does so through the whole dataset, else 0.
        shared: u32 { clean: 0, realistic: 0, rig: 1 },
        /// Focal lengths, relative.
        focal: f64 { clean: 0.0, realistic: 3e-3, rig: 2e-3 },
        /// Principal point, each coordinate \[px\] of an image 640 px wide.
        principal_px: f64 { clean: 0.0, realistic: 1.0, rig: 1.5 },
        /// Place of the hand in the camera frame, each axis \[m\].
        hand_translation: f64 { clean: 0.0, realistic: 2e-3, rig: 3e-3 },
        /// Turn of the hand in the camera frame, each axis \[deg\].
        hand_rotation_deg: f64 { clean: 0.0, realistic: 0.4, rig: 0.6 },
        /// Joint positions \[deg\], of prismatic joints in thousandths of `joint_deg` meters.
        joint_deg: f64 { clean: 0.0, realistic: 0.8 },
    }
    /// Standard deviations of what changes from frame to frame, beside the calibration's errors.
    play: PlaySettings {
        /// Place of the hand, each axis \[m\].
        hand_translation: f64 { clean: 0.0, realistic: 0.0, rig: 2e-4 },
        /// Turn of the hand, each axis \[deg\].
        hand_rotation_deg: f64 { clean: 0.0, realistic: 0.0, rig: 0.05 },
        /// Joint positions, as in `calibration`.
        joint_deg: f64 { clean: 0.0, realistic: 0.0, rig: 0.15 },
    }
    /// How the model that the estimator is given differs from the object.
    model: ModelSettings {
        /// Root mean square of the smooth displacement of the surface along its normal \[m\].
        deviation: f64 { clean: 0.0, realistic: 7e-4 },
        /// Wavelength of that displacement \[m\].
        wavelength: f64 { clean: 0.08, realistic: 0.08 },
        /// Standard deviation of the scale.
        scale: f64 { clean: 0.0, realistic: 3e-3 },
    }
}

/// Why a setting could not be set: there is none of that name, or the value is not of its kind.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{0}")]
pub struct SettingError(String);

impl SensorSettings {
    /// Sets the setting `key`, such as `depth.noise`, to the number `value`.
    ///
    /// # Errors
    /// [`SettingError`]; nothing has changed then.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), SettingError> {
        let mut all = self.to_json();
        let unknown = || {
            let known: Vec<String> = self.names().into_iter().map(|(name, _)| name).collect();
            let known = known.join(", ");
            SettingError(format!("there is no sensor setting {key:?}; there are {known}"))
        };
        let (group, name) = key.split_once('.').ok_or_else(unknown)?;
        let group = if group == "colour" { "color" } else { group };
        let slot = all.get_mut(group).and_then(|g| g.get_mut(name)).ok_or_else(unknown)?;
        let wrong = |expected| SettingError(format!("{key}: {value:?} is not {expected}"));
        if slot.is_u64() {
            let number: u32 = value.parse().map_err(|_| wrong("a whole number of at least 0"))?;
            *slot = Value::from(number);
        } else {
            let number: f64 = value.parse().map_err(|_| wrong("a number"))?;
            if !(number.is_finite() && number >= 0.0) {
                return Err(wrong("a finite number of at least 0"));
            }
            if name.ends_with("_share") && number > 1.0 {
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
