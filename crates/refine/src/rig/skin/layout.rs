//! A skin in the file of its rig.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::calibration::{ObjectMass, SkinCalibration, TaxelCalibration};

/// The field `skin` of a rig. Lists have one entry a taxel.
#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::rig) struct SkinLayout {
    gains: Vec<f64>,
    gain_sigmas: Vec<f64>,
    offsets_n: Vec<[f64; 3]>,
    dead: Vec<f64>,
    masses: BTreeMap<u32, MassLayout>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MassLayout {
    mass_kg: f64,
    sigma_kg: f64,
}

impl SkinLayout {
    /// The skin, or the field of it that is wrong, and how.
    pub(in crate::rig) fn read(self) -> Result<SkinCalibration, (String, String)> {
        let Self { gains, gain_sigmas, offsets_n, dead, masses } = self;
        let count = gains.len();
        let lengths = [
            ("gain_sigmas", gain_sigmas.len()),
            ("offsets_n", offsets_n.len()),
            ("dead", dead.len()),
        ];
        if let Some((name, found)) = lengths.into_iter().find(|(_, found)| *found != count) {
            let problem =
                format!("expected {count} entries, one a taxel as in gains, found {found}");
            return Err((format!("skin.{name}"), problem));
        }
        let finite =
            |values: &[f64], least: f64| values.iter().all(|v| v.is_finite() && *v > least);
        let wrong = |name: &str, problem: &str| Err((format!("skin.{name}"), problem.to_owned()));
        if !finite(&gains, 0.0) {
            return wrong("gains", "expected positive numbers");
        }
        if !finite(&gain_sigmas, 0.0) {
            return wrong("gain_sigmas", "expected positive numbers");
        }
        if !finite(offsets_n.as_flattened(), f64::NEG_INFINITY) {
            return wrong("offsets_n", "expected finite numbers");
        }
        if !dead.iter().all(|probability| (0.0..=1.0).contains(probability)) {
            return wrong("dead", "expected probabilities");
        }
        for (id, MassLayout { mass_kg, sigma_kg }) in &masses {
            if !finite(&[*mass_kg, *sigma_kg], 0.0) {
                return wrong(&format!("masses.{id}"), "expected positive numbers");
            }
        }
        let rest = offsets_n.into_iter().zip(dead);
        let all = gains.into_iter().zip(gain_sigmas).zip(rest);
        let taxel = |((gain, gain_sigma), (offset, dead))| TaxelCalibration {
            gain,
            gain_sigma,
            offset: Vector3::from(offset),
            dead,
        };
        let mass =
            |(id, MassLayout { mass_kg: mass, sigma_kg: sigma })| (id, ObjectMass { mass, sigma });
        let masses = masses.into_iter().map(mass).collect();
        Ok(SkinCalibration { taxels: all.map(taxel).collect(), masses })
    }
}

impl From<&SkinCalibration> for SkinLayout {
    fn from(skin: &SkinCalibration) -> Self {
        let taxels = || skin.taxels.iter();
        let mass = |(id, told): (&u32, &ObjectMass)| {
            (*id, MassLayout { mass_kg: told.mass, sigma_kg: told.sigma })
        };
        Self {
            gains: taxels().map(|taxel| taxel.gain).collect(),
            gain_sigmas: taxels().map(|taxel| taxel.gain_sigma).collect(),
            offsets_n: taxels().map(|taxel| taxel.offset.into()).collect(),
            dead: taxels().map(|taxel| taxel.dead).collect(),
            masses: skin.masses.iter().map(mass).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_skin_is_read_as_written_and_wrong_ones_are_named() {
        let taxel =
            TaxelCalibration { gain: 1.1, gain_sigma: 0.1, offset: Vector3::x(), dead: 0.25 };
        let masses = BTreeMap::from([(5, ObjectMass { mass: 0.5, sigma: 0.1 })]);
        let skin = SkinCalibration { taxels: vec![taxel; 3], masses };
        let written = || SkinLayout::from(&skin);
        assert_eq!(written().read(), Ok(skin.clone()));
        assert_eq!(SkinLayout::default().read(), Ok(SkinCalibration::default()));
        type Change = fn(&mut SkinLayout);
        let wrong: [(&str, Change); 6] = [
            ("skin.gains", |skin| skin.gains[1] = -1.0),
            ("skin.gain_sigmas", |skin| skin.gain_sigmas[0] = f64::INFINITY),
            ("skin.offsets_n", |skin| skin.offsets_n[2][1] = f64::NAN),
            ("skin.dead", |skin| skin.dead[0] = 1.5),
            ("skin.dead", |skin| skin.dead.truncate(2)),
            ("skin.masses.5", |skin| skin.masses.values_mut().for_each(|m| m.mass_kg = 0.0)),
        ];
        for (field, change) in wrong {
            let mut layout = written();
            change(&mut layout);
            assert_eq!(layout.read().unwrap_err().0, field);
        }
    }
}
