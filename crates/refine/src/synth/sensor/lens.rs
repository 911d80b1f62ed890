//! Images through a lens.

use prehend_render::{Camera, Distortion, DistortionError, Remap};

use super::rig::TrueView;
use crate::synth::plan::SynthSettings;

/// Pixels of the pinhole's image for one of the lens along each axis, which are averaged: a lens may
/// show things smaller than a pinhole does.
const FINE: usize = 3;
/// The pinhole sees at most so much more than the image at its center would.
const WIDEST: f64 = 3.0;

/// A camera's lens, and the pinhole camera whose images become its own.
pub(in crate::synth) struct SimulatedLens {
    pub(super) model: Distortion,
    /// True if datasets tell of the model.
    pub(super) is_declared: bool,
    /// Sees what the lens shows, `FINE` times finer.
    pub(super) pinhole: Camera,
    /// Pinhole at the resolution of the images, for the background.
    pub(super) background: Camera,
    color: Remap,
    centers: Remap,
}

impl SimulatedLens {
    /// Lens of the camera of `settings`.
    pub(in crate::synth) fn new(model: Distortion, settings: &SynthSettings) -> Self {
        let (camera, is_declared) = (&settings.camera(), !settings.undeclared_lens);
        let background = model.pinhole_that_covers(camera, WIDEST);
        let pinhole = background.scaled(FINE as f64);
        let color = Remap::distort(pinhole, camera.scaled(FINE as f64), &model);
        let centers = Remap::distort(pinhole, *camera, &model);
        Self { model, is_declared, pinhole, background, color, centers }
    }

    /// Images through the lens of what its pinhole sees.
    pub(super) fn photograph(&self, seen: &TrueView) -> Result<TrueView, DistortionError> {
        Ok(TrueView {
            color: self.color.rgb(&seen.color)?.downsampled(FINE),
            depth: self.centers.depth(&seen.depth)?,
            visible: self.centers.mask(&seen.visible)?,
            hand: self.centers.mask(&seen.hand)?,
            whole: self.centers.mask(&seen.whole)?,
        })
    }
}
