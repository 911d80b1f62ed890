//! Images through a lens.

use prehend_render::{Distortion, DistortionError};
use serde::Deserialize;

/// A lens: the name of its model, and the coefficients in the order of OpenCV.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "LensLayout")]
pub(crate) struct Lens(pub(crate) Distortion);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LensLayout {
    model: String,
    coefficients: Vec<f64>,
}

impl TryFrom<LensLayout> for Lens {
    type Error = DistortionError;

    fn try_from(layout: LensLayout) -> Result<Self, DistortionError> {
        Distortion::by_name(&layout.model, &layout.coefficients).map(Self)
    }
}
