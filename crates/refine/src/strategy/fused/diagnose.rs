//! Fault isolation: which sensor, if any, contradicts the others.

use std::fmt::{self, Display, Formatter};
use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};
use strum::IntoStaticStr;

use super::{Fused, FusedSettings, Modality};
use crate::MM_PER_M;
use crate::error::RefineError;
use crate::problem::State;
use crate::scene::PreparedFrame;
use crate::strategy::{Estimate, Strategy};

/// A refinement with one kind of evidence excluded.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The evidence left out, `color`, `depth`, `touch`, `views` (other cameras) or the name of a user-defined factor; `None` with all of it.
    pub excluded: Option<&'static str>,
    /// Estimate without that evidence.
    pub estimate: Estimate,
}

/// A [`Diagnosis`] in numbers that fit a line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DiagnosisSummary {
    /// The evidence left out; `None` with all of it.
    pub excluded: Option<String>,
    /// Probability that model, data and pose are right.
    pub probability: f64,
    /// Distance of the object's origin from where it is with all evidence \[mm\].
    pub distance_mm: f64,
    /// Angle between the rotations \[°\].
    pub angle_deg: f64,
}

impl DiagnosisSummary {
    /// Numbers of all that [`Fused::diagnose`] has found.
    pub fn of(diagnoses: &[Diagnosis]) -> Vec<Self> {
        let Some(all) = diagnoses.first().map(|all| all.estimate.t_cam_object()) else {
            return Vec::new();
        };
        let of = |diagnosis: &Diagnosis| {
            let pose = diagnosis.estimate.t_cam_object();
            let posterior = diagnosis.estimate.posterior.as_ref();
            Self {
                excluded: diagnosis.excluded.map(str::to_owned),
                probability: posterior.map_or(0.0, |posterior| posterior.probability()),
                distance_mm: MM_PER_M * (pose.translation.vector - all.translation.vector).norm(),
                angle_deg: pose.rotation.angle_to(&all.rotation).to_degrees(),
            }
        };
        diagnoses.iter().map(of).collect()
    }
}

impl Display for DiagnosisSummary {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { excluded, probability, distance_mm, angle_deg } = self;
        match excluded {
            None => write!(f, "with all evidence: probability {probability:.3}"),
            Some(what) => write!(
                f,
                "without {what}: probability {probability:.3}, {distance_mm:.2} mm and {angle_deg:.2}° away"
            ),
        }
    }
}

/// Sensors that may be at fault: colors of another texture, depth of what shines or lets light through, a skin that feels what is not there, cameras
/// that were moved. Outlines, and that things are not in the same place, are always evidence.
const SENSORS: [DiagnosedSensor; 4] = [
    DiagnosedSensor::Color,
    DiagnosedSensor::Depth,
    DiagnosedSensor::Touch,
    DiagnosedSensor::Views,
];

#[derive(Clone, Copy, PartialEq, Eq, IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
enum DiagnosedSensor {
    Color,
    Depth,
    Touch,
    Views,
}

impl DiagnosedSensor {
    /// Its evidence.
    fn modalities(self) -> &'static [Modality] {
        match self {
            Self::Color => &[Modality::Color],
            Self::Depth => &[Modality::Depth, Modality::FreeSpace],
            Self::Touch => &[Modality::Touch, Modality::Quiet],
            Self::Views => &[],
        }
    }

    /// Whether `frame` brings it, and it is used.
    fn is_in(self, frame: &PreparedFrame<'_>, settings: &FusedSettings) -> bool {
        let used = self.modalities().iter().any(|kind| settings.modalities.contains(kind));
        match self {
            Self::Color => used && frame.observation().has_colors(),
            Self::Depth => used && frame.masked_depths(1000).is_ok(),
            Self::Touch => {
                let hand = frame.hand();
                used && hand.is_some_and(|h| !h.forces.is_empty() || !h.touch.is_empty())
            }
            Self::Views => settings.views && !frame.views().is_empty(),
        }
    }
}

impl Fused {
    /// `estimate`, found from `initial` in `frame` with all evidence, then refinements without each user-defined factor and without each sensor: if one of
    /// them fits where all evidence together does not, what it leaves out contradicts the rest.
    ///
    /// # Errors
    /// Those of a run.
    pub fn diagnose(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &State,
        estimate: Estimate,
    ) -> Result<Vec<Diagnosis>, RefineError> {
        let run = |fused: &Self, excluded| {
            let estimate = fused.run(frame, initial, &mut |_| ControlFlow::Continue(()));
            estimate.map(|estimate| Diagnosis { excluded: Some(excluded), estimate })
        };
        let mut all = vec![Diagnosis { excluded: None, estimate }];
        for k in 0..self.factors.len() {
            let mut fused = self.clone();
            let name = fused.factors.remove(k).name();
            all.push(run(&fused, name)?);
        }
        for sensor in SENSORS.into_iter().filter(|sensor| sensor.is_in(frame, &self.settings)) {
            let mut fused = self.clone();
            fused.settings.modalities.retain(|modality| !sensor.modalities().contains(modality));
            fused.settings.views &= sensor != DiagnosedSensor::Views;
            all.push(run(&fused, sensor.into())?);
        }
        Ok(all)
    }
}
