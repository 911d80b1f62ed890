//! Scene of the contour mode.

use glam::Vec3;

use super::drawing::Drawing;
use crate::posed::Posed;
use crate::shading::surface::PosedLight;

/// A posed, lit model, and the point about which twists turn (camera frame).
pub(crate) struct ContourScene<'a> {
    pub(crate) posed: Posed<'a>,
    pub(crate) lighting: PosedLight,
    pub(crate) drawing: Drawing,
    pub(crate) twist_center: Vec3,
}

impl ContourScene<'_> {
    /// The model's center from where twists turn.
    #[inline(always)]
    pub(super) fn level_arm(&self) -> Vec3 {
        self.posed.center - self.twist_center
    }
}
