//! Nominal sizes of errors by name, as `--noise` has them.

use super::FusedSettings;
use crate::MM_PER_M;

/// Physical dimension of a size.
#[derive(Clone, Copy)]
enum NominalQuantity {
    Length,
    Angle,
    Ratio,
}

impl NominalQuantity {
    /// Its units, with their values in SI units.
    fn units(self) -> &'static [(&'static str, f64)] {
        match self {
            Self::Length => &[("mm", 1.0 / MM_PER_M), ("m", 1.0)],
            Self::Angle => const { &[("deg", 1_f64.to_radians()), ("rad", 1.0)] },
            Self::Ratio => &[("%", 1e-2), ("", 1.0)],
        }
    }
}

type Field = fn(&mut FusedSettings) -> Option<&mut f64>;

/// All sizes: standard deviations of the errors, for most objects and rigs.
const SIZES: [(&str, NominalQuantity, Field); 17] = [
    ("object.translation", NominalQuantity::Length, |s| Some(&mut s.prior.object_translation)),
    ("object.rotation", NominalQuantity::Angle, |s| Some(&mut s.prior.object_rotation)),
    ("hand.translation", NominalQuantity::Length, |s| Some(&mut s.prior.hand_translation)),
    ("hand.rotation", NominalQuantity::Angle, |s| Some(&mut s.prior.hand_rotation)),
    ("joints", NominalQuantity::Angle, |s| Some(&mut s.prior.joints)),
    ("joints.prismatic", NominalQuantity::Length, |s| Some(&mut s.prior.prismatic_joints)),
    ("depth.scale", NominalQuantity::Ratio, |s| Some(&mut s.prior.depth_scale)),
    ("depth.bias", NominalQuantity::Length, |s| Some(&mut s.prior.depth_bias)),
    ("depth.noise", NominalQuantity::Length, |s| Some(&mut s.depth.noise.sigma)),
    ("camera.principal-point", NominalQuantity::Ratio, |s| Some(&mut s.prior.principal_point)),
    ("camera.focal-length", NominalQuantity::Ratio, |s| Some(&mut s.prior.focal_scale)),
    ("camera.aspect", NominalQuantity::Ratio, |s| Some(&mut s.prior.aspect)),
    ("view.translation", NominalQuantity::Length, |s| Some(&mut s.prior.view_translation)),
    ("view.rotation", NominalQuantity::Angle, |s| Some(&mut s.prior.view_rotation)),
    ("model", NominalQuantity::Length, |s| Some(&mut s.patches.sigma)),
    ("model.scale", NominalQuantity::Ratio, |s| Some(&mut s.model_scale.sigma)),
    ("touch", NominalQuantity::Length, |s| {
        s.tactile.touch.noise_mut().map(|noise| &mut noise.sigma)
    }),
];

/// Standard deviation of what is exact, as a share of the nominal one.
const EXACT: f64 = 1e-4;

impl FusedSettings {
    /// Replaces the nominal size of the errors called `name` by `value`, a number with a unit such as `5mm`, `0.3deg` or `1%`; `0` for exact.
    ///
    /// By which factor they are larger or smaller is still learnt, as far as [`scales`](Self::scales) lets it.
    ///
    /// # Errors
    /// Reason that there is no such size, or that `value` is none.
    ///
    /// ```
    /// use prehend_refine::strategy::FusedSettings;
    ///
    /// let mut settings = FusedSettings::default();
    /// settings.set_nominal_size("hand.translation", "5mm")?;
    /// assert_eq!(settings.prior.hand_translation, 5e-3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn set_nominal_size(&mut self, name: &str, value: &str) -> Result<(), String> {
        let Some((_, quantity, field)) = SIZES.iter().find(|size| size.0 == name) else {
            let names = SIZES.map(|size| size.0).join(", ");
            return Err(format!("there is no size {name:?}: one of {names}"));
        };
        let units = quantity.units();
        let end = value.find(|c: char| c.is_alphabetic() && c != 'e' || c == '%');
        let (number, unit) = value.split_at(end.unwrap_or(value.len()));
        let number = number.trim().parse::<f64>().ok().filter(|n| n.is_finite() && *n >= 0.0);
        let factor = units.iter().find(|known| known.0 == unit).map(|known| known.1);
        let size = match (number, factor) {
            (Some(0.0), _) if unit.is_empty() => Some(0.0),
            (Some(number), Some(factor)) => Some(number * factor),
            _ => None,
        };
        let size = size.ok_or_else(|| {
            let units = units.iter().map(|known| known.0).filter(|unit| !unit.is_empty());
            let units = units.collect::<Vec<_>>().join(", ");
            format!("{value:?} is not a size: a number that is not negative, with one of the units {units}")
        })?;
        let Some(field) = field(self) else { return Ok(()) };
        let before = std::mem::replace(field, if size > 0.0 { size } else { EXACT * *field });
        // What is forgiven beyond larger errors begins farther out; exact data may have the outliers that they had.
        let noise = match name {
            "depth.noise" => Some(&mut self.depth.noise),
            "touch" => self.tactile.touch.noise_mut(),
            _ => None,
        };
        if let Some(noise) = noise {
            *noise = noise.widened((noise.sigma / before).max(1.0));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_size_is_set_in_its_units() {
        for (name, quantity, field) in SIZES {
            let mut settings = FusedSettings::default();
            for &(unit, factor) in quantity.units() {
                settings.set_nominal_size(name, &format!("2.5{unit}")).unwrap();
                assert_eq!(field(&mut settings), Some(&mut (2.5 * factor)));
            }
            settings.set_nominal_size(name, "0").unwrap();
            assert!(field(&mut settings).is_some_and(|size| *size > 0.0 && *size < 1e-3));
        }
    }

    #[test]
    fn what_is_no_size_is_refused() {
        let mut settings = FusedSettings::default();
        for value in ["", "mm", "-1mm", "nanmm", "1", "1deg", "1e400mm"] {
            let error = settings.set_nominal_size("hand.translation", value).unwrap_err();
            assert!(error.ends_with("one of the units mm, m"), "{value} {error}");
        }
        let error = settings.set_nominal_size("hand.rotaton", "1deg").unwrap_err();
        assert!(error.contains("hand.rotation"));
        assert_eq!(settings, FusedSettings::default());
        settings.set_nominal_size("depth.bias", "1e-3m").unwrap();
        assert_eq!(settings.prior.depth_bias, 1e-3);
    }
}
