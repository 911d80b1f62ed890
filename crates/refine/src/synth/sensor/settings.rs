//! Settings of all sensors, and presets of them.

use toml::{Table, Value};

use crate::defaults::settings;
use crate::error::SettingsError;
use crate::settings::merge;
use crate::synth::settings::{numbers, preset};

settings! {
    /// Settings of all sensor models.
    ///
    /// ```
    /// use prehend_refine::synth::SensorSettings;
    ///
    /// let mut sensors = SensorSettings::realistic();
    /// sensors.set("depth.scale", "0")?;
    /// assert!(sensors.names().contains(&("depth.scale".to_owned(), 0.0)));
    /// let unknown = sensors.set("depth.scael", "0").unwrap_err();
    /// assert!(unknown.to_string().contains("`scale`"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub struct SensorSettings {
        /// Places of cameras about the hand.
        pub(crate) viewpoint: ViewpointSettings = ViewpointSettings::default(),
        /// Lamps, highlights and shadows.
        pub(crate) light: LightSettings = LightSettings::default(),
        /// The room behind the hand.
        pub(crate) background: BackgroundSettings = BackgroundSettings::default(),
        /// Faults of the color images. Zero takes any of them away.
        pub(crate) color: ColorSettings = ColorSettings::default(),
        /// Faults of the depth images. Zero takes any of them away.
        pub(crate) depth: DepthSettings = DepthSettings::default(),
        /// Faults of the masks. Zero takes any of them away.
        pub(crate) mask: MaskSettings = MaskSettings::default(),
        /// Faults of the taxels. Forces are in sensor units, 1000 a newton.
        pub(crate) touch: TouchSettings = TouchSettings::default(),
        /// Standard deviations of the calibration's errors, which stay the same through a grasp.
        pub(crate) calibration: CalibrationSettings = CalibrationSettings::default(),
        /// Standard deviations of what changes from frame to frame, beside the calibration's errors.
        pub(crate) play: PlaySettings = PlaySettings::default(),
        /// Differences of the model that the estimator is given from the object.
        pub(crate) model: ModelSettings = ModelSettings::default(),
    }
}

settings! {
    /// Places of cameras about the hand.
    pub(crate) struct ViewpointSettings {
        /// Nearest distance from the object's center \[m\].
        pub(crate) nearest: f64 = 0.4,
        /// Farthest distance \[m\].
        pub(crate) farthest: f64 = 0.6,
        /// Focal length, as a share of the image's width.
        pub(crate) focal_width_ratio: f64 = 0.906,
        /// Standard deviation of where the camera aims, per axis \[m\].
        pub(crate) aim: f64 = 0.015,
        /// Standard deviation of the angle between the image's vertical and the world's \[deg\].
        pub(crate) roll_deg: f64 = 8.0,
        /// Largest share of the object that the hand may hide, where a view with less can be found.
        pub(crate) hidden_share: f64 = 0.55,
    }
}

settings! {
    /// Lamps, highlights and shadows.
    pub(crate) struct LightSettings {
        /// Lamps beside the light from everywhere; the first is the strongest.
        pub(crate) lamps: u32 = 2,
        /// Share of the light that comes from everywhere.
        pub(crate) ambient_share: f64 = 0.5,
        /// Standard deviation of a lamp's color per channel.
        pub(crate) tint: f64 = 0.03,
        /// Strength of the highlights.
        pub(crate) gloss: f64 = 0.0,
        /// Share of the first lamp's light that its shadow takes away.
        pub(crate) shadow_share: f64 = 0.0,
    }
}

settings! {
    /// The room behind the hand.
    pub(crate) struct BackgroundSettings {
        /// Mean distance of the wall \[m\].
        pub(crate) distance: f64 = 1.4,
        /// Standard deviation of the wall's slopes.
        pub(crate) slope: f64 = 0.1,
        /// Things in front of the wall, at most.
        pub(crate) things: u32 = 0,
        /// Standard deviation of the wall's pattern per channel.
        pub(crate) pattern: f64 = 0.0,
    }
}

settings! {
    /// Faults of the color images. Zero takes any of them away.
    pub(crate) struct ColorSettings {
        /// Standard deviation of the exposure \[stops\].
        pub(crate) exposure: f64 = 0.0,
        /// Standard deviation of the gain of each channel.
        pub(crate) white_balance: f64 = 0.0,
        /// Standard deviation of the blur \[px\], at most.
        pub(crate) blur: f64 = 0.0,
        /// Standard deviation of the noise of each channel in the dark.
        pub(crate) noise: f64 = 0.01,
        /// Variance that noise gains with brightness, up to white.
        pub(crate) shot_noise: f64 = 0.0,
        /// Quality of the JPEG files, 1 to 100; 0 for PNG, which loses nothing.
        pub(crate) jpeg_quality: u8 = 0,
    }
}

settings! {
    /// Faults of the depth images. Zero takes any of them away.
    pub(crate) struct DepthSettings {
        /// Standard deviation of the scale error, the same through a grasp.
        pub(crate) scale: f64 = 0.0,
        /// Standard deviation of a smooth warp that changes over a third of the image, the same through a grasp \[m\].
        pub(crate) warp: f64 = 0.0,
        /// Standard deviation of noise of single pixels, at half a meter; it grows with the square of the depth \[m\].
        pub(crate) noise: f64 = 7e-4,
        /// Standard deviation of noise with a correlation over `correlation` pixels, at half a meter \[m\].
        pub(crate) correlated_noise: f64 = 0.0,
        /// Reach of the correlated noise \[px\].
        pub(crate) correlation: f64 = 3.0,
        /// Steps of the disparity \[px\].
        pub(crate) disparity_step: f64 = 0.0,
        /// Distance of the two eyes \[m\]: with the focal length it makes disparity of depth, and what only one of them sees has
        /// none.
        pub(crate) baseline: f64 = 0.0,
        /// Spread of near surfaces over what is behind them \[px\], at most.
        pub(crate) fattening: f64 = 0.0,
        /// Share of the pixels at edges whose depth lies between that of both sides.
        pub(crate) flying_share: f64 = 0.0,
        /// Share of the pixels that are lost in patches.
        pub(crate) hole_share: f64 = 0.0,
        /// Angle of sight to surface below which half of the pixels are lost \[deg\].
        pub(crate) grazing_deg: f64 = 0.0,
    }
}

settings! {
    /// Faults of the masks. Zero takes any of them away.
    pub(crate) struct MaskSettings {
        /// Standard deviation of the outline's place \[px\].
        pub(crate) wobble: f64 = 0.0,
        /// Length along the outline over which it wobbles \[px\].
        pub(crate) wobble_length: f64 = 12.0,
        /// Reach of leaks of the mask onto the hand \[px\].
        pub(crate) leak: f64 = 0.0,
        /// Share of the border with the hand where it leaks.
        pub(crate) leak_share: f64 = 0.0,
    }
}

settings! {
    /// Faults of the taxels. Forces are in sensor units, 1000 a newton.
    pub(crate) struct TouchSettings {
        /// Share of the taxels that say nothing, the same ones through a grasp.
        pub(crate) dead_share: f64 = 0.0,
        /// Share of the taxels that feel what is not there, the same ones through a grasp.
        pub(crate) false_share: f64 = 0.0,
        /// Mean size of what those feel \[units\].
        pub(crate) false_force: f64 = 0.0,
        /// Largest error of a taxel's gain, uniform, the same through a grasp.
        pub(crate) gain: f64 = 0.0,
        /// Standard deviation of the noise of each axis \[units\].
        pub(crate) noise: f64 = 0.0,
        /// Forces smaller than this read as none \[units\].
        pub(crate) threshold: f64 = 0.0,
        /// Step of the readings \[units\].
        pub(crate) quantum: f64 = 1.0,
        /// Largest reading of an axis \[units\].
        pub(crate) limit: f64 = 10000.0,
    }
}

settings! {
    /// Standard deviations of the calibration's errors, which stay the same through a grasp.
    pub(crate) struct CalibrationSettings {
        /// 1 if all that stays the same through a grasp does so through the whole dataset, else 0.
        pub(crate) shared: u32 = 0,
        /// Focal lengths, relative.
        pub(crate) focal: f64 = 0.0,
        /// Principal point, each coordinate \[px\] of an image 640 px wide.
        pub(crate) principal_px: f64 = 0.0,
        /// Place of the hand in the camera frame, each axis \[m\].
        pub(crate) hand_translation: f64 = 0.0,
        /// Turn of the hand in the camera frame, each axis \[deg\].
        pub(crate) hand_rotation_deg: f64 = 0.0,
        /// Joint positions \[deg\], of prismatic joints in thousandths of `joint_deg` meters.
        pub(crate) joint_deg: f64 = 0.0,
    }
}

settings! {
    /// Standard deviations of what changes from frame to frame, beside the calibration's errors.
    pub(crate) struct PlaySettings {
        /// Place of the hand, each axis \[m\].
        pub(crate) hand_translation: f64 = 0.0,
        /// Turn of the hand, each axis \[deg\].
        pub(crate) hand_rotation_deg: f64 = 0.0,
        /// Joint positions, as in `calibration`.
        pub(crate) joint_deg: f64 = 0.0,
    }
}

settings! {
    /// Differences of the model that the estimator is given from the object.
    pub(crate) struct ModelSettings {
        /// Root mean square of the smooth displacement of the surface along its normal \[m\].
        pub(crate) deviation: f64 = 0.0,
        /// Wavelength of that displacement \[m\].
        pub(crate) wavelength: f64 = 0.08,
        /// Standard deviation of the scale.
        pub(crate) scale: f64 = 0.0,
    }
}

impl SensorSettings {
    /// Little noise in color and depth; exact calibration and model.
    pub fn clean() -> Self {
        Self::default()
    }

    /// A stereo camera and tactile sensors with realistic faults.
    pub fn realistic() -> Self {
        preset(&[include_str!("realistic.toml")])
    }

    /// Those of one rig: faults of cameras, hand and skin are the same in every frame.
    pub fn rig() -> Self {
        preset(&[include_str!("realistic.toml"), include_str!("rig.toml")])
    }

    /// Sets the setting `key`, such as `depth.noise`, to the number `value`.
    ///
    /// # Errors
    /// [`SettingsError::Value`]; nothing has changed then.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), SettingsError> {
        let wrong = |problem: &dyn std::fmt::Display| {
            SettingsError::value(format!("{key}={value}"), problem)
        };
        let changes: Table = format!("{key} = {value}").parse().map_err(|_| wrong(&"no number"))?;
        let mut all = Value::try_from(&*self).map_err(|error| wrong(&error))?;
        merge(&mut all, changes.into());
        let changed: Self = all.try_into().map_err(|error| wrong(&error))?;
        for (name, number) in changed.names() {
            if !(number.is_finite() && number >= 0.0) {
                return Err(wrong(&"not a finite number of at least 0"));
            }
            if name.ends_with("_share") && number > 1.0 {
                return Err(wrong(&"not a share between 0 and 1"));
            }
        }
        *self = changed;
        Ok(())
    }

    /// Every setting's name, such as `depth.noise`, with its value.
    pub fn names(&self) -> Vec<(String, f64)> {
        numbers(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_setting_can_be_set_by_its_name() {
        let mut settings = SensorSettings::rig();
        let names = settings.names();
        assert!(names.len() > 40 && names.iter().all(|(_, v)| v.is_finite()));
        for (name, _) in &names {
            settings.set(name, "1").unwrap();
        }
        assert!(settings.names().iter().all(|(_, v)| *v == 1.0));
    }

    #[test]
    fn presets_differ_from_each_other() {
        let [clean, realistic, rig] =
            [SensorSettings::clean(), SensorSettings::realistic(), SensorSettings::rig()];
        assert_eq!((clean.depth.scale, realistic.depth.scale, rig.depth.scale), (0.0, 4e-3, 6e-3));
        assert_eq!((clean.light.lamps, realistic.light.lamps, rig.light.lamps), (2, 3, 3));
        assert_eq!((realistic.calibration.shared, rig.calibration.shared), (0, 1));
    }

    #[test]
    fn wrong_names_and_values_are_refused_and_change_nothing() {
        let mut settings = SensorSettings::clean();
        for (key, value, said) in [
            ("noise", "1", "unknown field `noise`"),
            ("depth.nose", "1", "`noise`"),
            ("depth.noise", "little", "depth.noise=little: no number"),
            ("depth.noise", "-1", "at least 0"),
            ("depth.noise", "nan", "finite"),
            ("depth.hole_share", "1.5", "a share between 0 and 1"),
            ("light.lamps", "1.5", "light.lamps=1.5"),
            ("color.jpeg_quality", "300", "color.jpeg_quality=300"),
        ] {
            let error = settings.set(key, value).unwrap_err().to_string();
            assert!(error.contains(said), "{key}={value}: {error}");
        }
        assert_eq!(settings, SensorSettings::clean());
    }
}
