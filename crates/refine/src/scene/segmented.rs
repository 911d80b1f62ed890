//! The segmented image that the object is compared with.

use std::sync::Arc;

use prehend_render::{DepthImage, Target, TargetError};

use super::Observation;
use crate::error::RefineError;

/// The object in an image, with what may hide it.
#[derive(Clone)]
pub(crate) struct Segmented {
    pub(crate) target: Arc<Target>,
    /// Root mean square of the colors under the mask.
    pub(crate) brightness: f64,
}

impl Segmented {
    /// The object in `observation`; `occluder` is the depth image of what may hide it.
    ///
    /// # Errors
    /// If the images do not fit the camera or the mask is empty.
    pub(super) fn new(
        observation: &Observation,
        occluder: DepthImage,
    ) -> Result<Self, RefineError> {
        let target = Target::new(observation.camera, &observation.color, &observation.mask)
            .and_then(|t| t.with_occluder(occluder))
            .map_err(images)?;
        Ok(Self { target: Arc::new(target), brightness: brightness(observation) })
    }

    /// The same made smaller by `factor`.
    ///
    /// # Errors
    /// If nothing of the mask is left.
    pub(super) fn downsampled(&self, factor: usize) -> Result<Self, RefineError> {
        let target = match factor {
            1 => Arc::clone(&self.target),
            _ => Arc::new(self.target.downsampled(factor).map_err(images)?),
        };
        Ok(Self { target, ..*self })
    }
}

fn images(error: TargetError) -> RefineError {
    RefineError::Images(error.to_string())
}

/// Root mean square of the colors under the mask; never zero.
fn brightness(observation: &Observation) -> f64 {
    let pixels = observation.color.pixels().iter().zip(observation.mask.pixels());
    let (sum, count) = pixels
        .filter(|(_, m)| **m)
        .flat_map(|(c, _)| c)
        .fold((0.0, 0.0), |(s, n), &v| (s + f64::from(v).powi(2), n + 1.0));
    (sum / f64::max(count, 1.0)).sqrt().max(0.02)
}
