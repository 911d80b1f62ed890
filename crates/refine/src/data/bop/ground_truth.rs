//! The truth about a dataset, for scoring only.

use nalgebra::Isometry3;
use serde::Deserialize;

use super::bodies::SceneBodies;
use super::dataset::Dataset;
use super::error::DatasetError;
use super::json::JsonFile;
use super::models::Models;
use super::numbers::{Numbers, Rotation, pose};

/// What scorers may read and estimators must not: `scene_gt.json`, `scene_gt_info.json`, `scene_bodies_gt.json` and
/// `models_eval/`.
#[derive(Debug)]
pub struct GroundTruth<'a> {
    pub(super) dataset: &'a Dataset,
    models: Models,
}

/// An object where it truly is.
#[derive(Clone, Debug, PartialEq)]
pub struct TrueObject {
    /// Which object.
    pub obj_id: u32,
    /// Maps model coordinates into the camera frame \[m\].
    pub t_cam_model: Isometry3<f64>,
}

#[derive(Deserialize)]
struct ObjectEntry {
    obj_id: u32,
    #[serde(rename = "cam_R_m2c")]
    rotation: Rotation,
    #[serde(rename = "cam_t_m2c")]
    translation: Numbers<3>,
}

impl<'a> GroundTruth<'a> {
    /// The truth about the split that `dataset` shows; nothing is read yet.
    pub fn new(dataset: &'a Dataset) -> Self {
        let eval = dataset.root().join("models_eval");
        let models = if eval.is_dir() { eval } else { dataset.models().dir().to_path_buf() };
        Self { dataset, models: Models::new(models) }
    }

    /// The models to score with: `models_eval/` where the dataset has it, else `models/`.
    pub fn models(&self) -> &Models {
        &self.models
    }

    /// The objects of an image, in the order that numbers its masks.
    ///
    /// # Errors
    /// When `scene_gt.json` is absent or broken, or lacks the image or one of its fields.
    pub fn objects(&self, scene_id: u32, im_id: u32) -> Result<Vec<TrueObject>, DatasetError> {
        let file = self.objects_file(scene_id)?;
        let entries: Vec<ObjectEntry> = file.entry(im_id)?;
        file.check_rotations(entries.iter().map(|entry| &entry.rotation));
        let object = |ObjectEntry { obj_id, rotation, translation }| TrueObject {
            obj_id,
            t_cam_model: pose(&rotation, &translation),
        };
        Ok(entries.into_iter().map(object).collect())
    }

    /// The true pose of the object `obj_id`; among several such objects, of the one nearest to `estimate`.
    ///
    /// # Errors
    /// Those of [`GroundTruth::objects`], and [`DatasetError::UnknownObject`] when the image shows no such
    /// object.
    pub fn pose(
        &self,
        scene_id: u32,
        im_id: u32,
        obj_id: u32,
        estimate: &Isometry3<f64>,
    ) -> Result<Isometry3<f64>, DatasetError> {
        let distance = |o: &TrueObject| {
            (o.t_cam_model.translation.vector - estimate.translation.vector).norm()
        };
        let file = self.objects_file(scene_id)?;
        self.objects(scene_id, im_id)?
            .into_iter()
            .filter(|o| o.obj_id == obj_id)
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .map(|o| o.t_cam_model)
            .ok_or_else(|| DatasetError::UnknownObject { file: file.path().into(), obj_id })
    }

    /// Whether a scene says where its robots are.
    ///
    /// # Errors
    /// When there is no such scene.
    pub(crate) fn has_bodies(&self, scene_id: u32) -> Result<bool, DatasetError> {
        Ok(self.bodies_file(scene_id)?.exists())
    }

    /// The robots where they truly are: `scene_bodies_gt.json` where the scene has it, else what
    /// estimators are told.
    ///
    /// # Errors
    /// When the file is absent or broken, or lacks the image or one of its fields.
    pub fn bodies(&self, scene_id: u32, im_id: u32) -> Result<SceneBodies, DatasetError> {
        SceneBodies::read(self.bodies_file(scene_id)?, im_id, self.dataset.root())
    }

    /// `scene_gt.json`.
    pub(super) fn objects_file(&self, scene_id: u32) -> Result<&JsonFile, DatasetError> {
        self.dataset.scene(scene_id).map(|scene| &scene.objects)
    }

    fn bodies_file(&self, scene_id: u32) -> Result<&JsonFile, DatasetError> {
        let scene = self.dataset.scene(scene_id)?;
        Ok(if scene.true_bodies.exists() { &scene.true_bodies } else { &scene.bodies })
    }
}
