//! Calibrated rigs.

use std::fmt;
use std::path::Path;

use serde::Serialize;

use super::InfoError;
use super::lines::{line, listed};
use crate::rig::Rig;

/// What is known of a rig.
#[derive(Clone, Debug, Serialize)]
pub struct RigInfo {
    /// Columns and rows of its images.
    pub image_size: [usize; 2],
    /// Joints of its hand.
    pub joints: usize,
    /// Ids of the objects whose surfaces are corrected.
    pub objects: Vec<u32>,
    /// What is corrected, without the coefficients of depth's field.
    pub parameters: Vec<ParameterInfo>,
}

/// A parameter of a rig.
#[derive(Clone, Debug, Serialize)]
pub struct ParameterInfo {
    /// Its name.
    pub name: String,
    /// Its value \[m, rad; focal lengths\].
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

impl RigInfo {
    pub(super) fn read(path: &Path) -> Result<Self, InfoError> {
        let rig = Rig::load(path)?;
        let sigmas = rig.covariance.diagonal();
        let parameters = rig.parameters().into_iter().zip(sigmas.iter());
        Ok(Self {
            image_size: rig.image_size(),
            joints: rig.joints.len(),
            objects: rig.objects.keys().copied().collect(),
            parameters: parameters
                .map(|((name, value), variance)| ParameterInfo {
                    name,
                    value,
                    sigma: variance.sqrt(),
                })
                .collect(),
        })
    }
}

impl fmt::Display for RigInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.image_size;
        line(f, "images", format!("{width}x{height} pixels"))?;
        line(f, "joints", self.joints)?;
        line(f, "objects", listed(&self.objects))?;
        line(f, "parameters", "value and standard deviation")?;
        for ParameterInfo { name, value, sigma } in &self.parameters {
            writeln!(f, "    {name:<26} {value:>10.5} ± {sigma:.5}")?;
        }
        Ok(())
    }
}
