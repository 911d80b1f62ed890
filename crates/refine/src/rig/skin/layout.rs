//! A skin in the file of its rig.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::calibration::{SkinCalibration, TaxelCalibration};

/// The field `skin` of a rig. Lists have one entry a taxel.
#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::rig) struct SkinLayout {
    offsets_n: Vec<[f64; 3]>,
    dead: Vec<f64>,
}

impl SkinLayout {
    /// The skin, or the field of it that is wrong, and how.
    pub(in crate::rig) fn read(self) -> Result<SkinCalibration, (String, String)> {
        let Self { offsets_n, dead } = self;
        let wrong = |name: &str, problem: String| Err((format!("skin.{name}"), problem));
        let (count, found) = (offsets_n.len(), dead.len());
        if found != count {
            let problem =
                format!("expected {count} entries, one a taxel as in offsets_n, found {found}");
            return wrong("dead", problem);
        }
        if !offsets_n.as_flattened().iter().all(|offset| offset.is_finite()) {
            return wrong("offsets_n", "expected finite numbers".to_owned());
        }
        if !dead.iter().all(|probability| (0.0..=1.0).contains(probability)) {
            return wrong("dead", "expected probabilities".to_owned());
        }
        let taxel = |(offset, dead): ([f64; 3], f64)| TaxelCalibration {
            offset: Vector3::from(offset),
            dead,
        };
        Ok(SkinCalibration { taxels: offsets_n.into_iter().zip(dead).map(taxel).collect() })
    }
}

impl From<&SkinCalibration> for SkinLayout {
    fn from(skin: &SkinCalibration) -> Self {
        Self {
            offsets_n: skin.taxels.iter().map(|taxel| taxel.offset.into()).collect(),
            dead: skin.taxels.iter().map(|taxel| taxel.dead).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_skin_is_read_as_written_and_wrong_ones_are_named() {
        let taxel = TaxelCalibration { offset: Vector3::x(), dead: 0.25 };
        let skin = SkinCalibration { taxels: vec![taxel; 3] };
        let written = || SkinLayout::from(&skin);
        assert_eq!(written().read(), Ok(skin.clone()));
        assert_eq!(SkinLayout::default().read(), Ok(SkinCalibration::default()));
        type Change = fn(&mut SkinLayout);
        let wrong: [(&str, Change); 3] = [
            ("skin.offsets_n", |skin| skin.offsets_n[2][1] = f64::NAN),
            ("skin.dead", |skin| skin.dead[0] = 1.5),
            ("skin.dead", |skin| skin.dead.truncate(2)),
        ];
        for (field, change) in wrong {
            let mut layout = written();
            change(&mut layout);
            assert_eq!(layout.read().unwrap_err().0, field);
        }
    }
}
