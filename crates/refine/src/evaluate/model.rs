//! Evaluation models: what metrics need of an object, prepared once for many poses.

use nalgebra::Isometry3;
use prehend_geometry::cloud::diameter;
use prehend_render::{Camera, DepthImage, ModelError, RenderModel, depth_map};

use crate::data::bop::{Models, present};
use crate::data::{AssetError, ContactModel, load_mesh};
use crate::error::RefineError;
use crate::evaluate::metrics::{NormalizedErrors, ScoredModel, VSD_TOLERANCES, vsd};

/// An object to score poses of.
pub(super) struct EvaluationModel {
    /// Its vertices and symmetries.
    pub(super) points: ScoredModel,
    /// Its diameter \[m\].
    pub(super) diameter: f64,
    drawn: RenderModel,
    /// Its model of contact with the hand.
    pub(super) contact: ContactModel,
}

impl EvaluationModel {
    /// The object `obj_id` of `models`. Without an entry of `models_info.json` it has no
    /// symmetries, and the diameter of its vertices.
    ///
    /// # Errors
    /// If `models_info.json` is broken (without its symmetries, a symmetric object would be scored wrongly), or the mesh, or it cannot be rendered.
    pub(super) fn new(models: &Models, obj_id: u32) -> Result<Self, AssetError> {
        let mesh = load_mesh(models, obj_id)?;
        let (symmetries, diameter) = match present(models.info(obj_id))? {
            Some(info) => (info.symmetries, info.diameter),
            None => (Default::default(), diameter(&mesh.vertices)),
        };
        let unusable = |e: ModelError| RefineError::Object {
            object: format!("{obj_id}"),
            reason: e.to_string(),
        };
        let contact = ContactModel::new(&mesh);
        let mesh = mesh.faced_outward();
        let drawn = RenderModel::new(&mesh).map_err(unusable)?;
        Ok(Self { points: ScoredModel::new(mesh.vertices, symmetries), diameter, drawn, contact })
    }

    /// The visible surface discrepancy (0..=1) for each of BOP's tolerances. `sensed` is the depth image of the scene \[m\],
    /// of `camera`'s size.
    pub(super) fn vsd(
        &self,
        estimate: &Isometry3<f64>,
        truth: &Isometry3<f64>,
        camera: &Camera,
        sensed: &DepthImage,
    ) -> [f64; VSD_TOLERANCES.len()] {
        let draw = |pose: &Isometry3<f64>| depth_map(camera, &[(&self.drawn, *pose)]);
        vsd(camera, sensed, &draw(estimate), &draw(truth), self.diameter)
    }

    /// The errors that BOP thresholds, `sensed` as for [`EvaluationModel::vsd`]; without it no visible surface is right.
    pub(super) fn errors(
        &self,
        estimate: &Isometry3<f64>,
        truth: &Isometry3<f64>,
        camera: &Camera,
        sensed: Option<&DepthImage>,
    ) -> NormalizedErrors {
        let vsd = sensed.map(|sensed| self.vsd(estimate, truth, camera, sensed));
        NormalizedErrors::new(
            &vsd.unwrap_or([f64::INFINITY; VSD_TOLERANCES.len()]),
            self.points.mssd(estimate, truth),
            self.diameter,
            self.points.mspd(estimate, truth, camera),
            camera.width,
        )
    }
}
