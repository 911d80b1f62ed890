//! The SoftRas mode.

use nalgebra::{Isometry3, Point3};

use crate::camera::Camera;
use crate::light::Light;
use crate::mode::SoftRasOptions;
use crate::model::RenderModel;
use crate::pose_loss::{Seen, View};
use crate::posed::Posed;
use crate::projected::Region;

/// A posed model whose faces spread beyond their borders.
pub(crate) struct SoftRasView<'a> {
    posed: Posed<'a>,
    region: Region,
}

impl<'a> SoftRasView<'a> {
    /// Twists turn about `center` (camera frame \[m\]). Besides the pixels that the model may cover, those of `also` are
    /// visited.
    pub(crate) fn new(
        _options: &SoftRasOptions,
        model: &'a RenderModel,
        pose: &Isometry3<f64>,
        _center: &Point3<f64>,
        camera: &Camera,
        _light: &Light,
        also: &Region,
    ) -> Self {
        let posed = Posed::new(model, camera, pose, 0.0);
        let region = posed.projected.region.union(also);
        Self { posed, region }
    }
}

impl View for SoftRasView<'_> {
    fn blocks(&self) -> usize {
        0
    }

    fn right(&self) -> usize {
        self.region.x1
    }

    fn visit<const DERIVATIVES: bool>(
        &self,
        _block: usize,
        _each: impl FnMut(usize, usize, Option<Seen>),
    ) {
        let _ = &self.posed;
    }

    fn faces(&self, _block: usize, _each: impl FnMut(usize, usize, u32, [f32; 3])) {}
}
