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
    /// Taxels of which something is known.
    pub taxels: usize,
    /// Those of them that are probably dead.
    pub dead_taxels: usize,
    /// Those of them that ring false.
    pub false_taxels: usize,
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
        let taxels = &rig.skin.taxels;
        Ok(Self {
            image_size: rig.image_size(),
            joints: rig.joints.len(),
            objects: rig.objects.keys().copied().collect(),
            taxels: taxels.len(),
            dead_taxels: taxels.iter().filter(|taxel| taxel.is_dead()).count(),
            false_taxels: taxels.iter().filter(|taxel| taxel.rings_false()).count(),
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
        let Self { image_size: [width, height], taxels, dead_taxels, false_taxels, .. } = self;
        line(f, "images", format!("{width}x{height} pixels"))?;
        line(f, "joints", self.joints)?;
        line(f, "objects", listed(&self.objects))?;
        let told = format!("{taxels}, {dead_taxels} of them dead, {false_taxels} ring false");
        line(f, "taxels", told)?;
        line(f, "parameters", "value and standard deviation")?;
        for ParameterInfo { name, value, sigma } in &self.parameters {
            writeln!(f, "    {name:<26} {value:>10.5} ± {sigma:.5}")?;
        }
        Ok(())
    }
}
