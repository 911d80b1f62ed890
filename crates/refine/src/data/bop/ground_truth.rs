//! The truth about a dataset, for scoring only.

use nalgebra::Isometry3;
use serde::Deserialize;

use super::bodies::SceneBodies;
use super::dataset::Dataset;
use super::error::DatasetError;
use super::json::JsonFile;
use super::models::Models;
use super::numbers::Numbers;
use super::pose::{Rotation, pose};

/// Ground truth, which scorers may read and estimators must not: `scene_gt.json`, `scene_gt_info.json`, `scene_bodies_gt.json` and
/// `models_eval/`.
#[derive(Debug)]
pub struct GroundTruth<'a> {
    dataset: &'a Dataset,
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

#[derive(Deserialize)]
struct VisibilityEntry {
    visib_fract: f64,
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
    /// Those of [`GroundTruth::objects`], and [`DatasetError::Unusable`] when the image shows no such
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
            .ok_or_else(|| {
                DatasetError::unusable(file.path(), format!("unknown object id {obj_id}"))
            })
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
    fn objects_file(&self, scene_id: u32) -> Result<&JsonFile, DatasetError> {
        self.dataset.scene(scene_id).map(|scene| &scene.objects)
    }

    fn bodies_file(&self, scene_id: u32) -> Result<&JsonFile, DatasetError> {
        let scene = self.dataset.scene(scene_id)?;
        Ok(if scene.true_bodies.exists() { &scene.true_bodies } else { &scene.bodies })
    }

    /// The visible fraction of the silhouette (0..=1) of each of an image's `count` objects, in the order of
    /// [`GroundTruth::objects`].
    ///
    /// # Errors
    /// When `scene_gt_info.json` is absent or broken, lacks the image, or has another number of objects.
    pub(crate) fn visible_fractions(
        &self,
        scene_id: u32,
        im_id: u32,
        count: usize,
    ) -> Result<Vec<f64>, DatasetError> {
        let file = &self.dataset.scene(scene_id)?.visibility;
        let entries: Vec<VisibilityEntry> = file.entry(im_id)?;
        if entries.len() != count {
            let problem = format!("has {} objects but scene_gt.json {count}", entries.len());
            return Err(DatasetError::field(file.path(), &im_id.to_string(), problem));
        }
        Ok(entries.into_iter().map(|entry| entry.visib_fract).collect())
    }

    /// The true poses of `count` instances of an object, the most visible ones if the image shows more.
    ///
    /// # Errors
    /// Those of [`GroundTruth::objects`], [`DatasetError::Unusable`] if the image shows fewer, and those of
    /// [`GroundTruth::visible_fractions`] if it shows more.
    pub(crate) fn most_visible(
        &self,
        scene_id: u32,
        im_id: u32,
        obj_id: u32,
        count: usize,
    ) -> Result<Vec<Isometry3<f64>>, DatasetError> {
        let objects = self.objects(scene_id, im_id)?;
        let mut shown: Vec<usize> =
            (0..objects.len()).filter(|&k| objects[k].obj_id == obj_id).collect();
        if shown.len() < count {
            let file = self.objects_file(scene_id)?.path();
            let problem =
                format!("instances of object {obj_id}: {} but targets {count}", shown.len());
            return Err(DatasetError::field(file, &im_id.to_string(), problem));
        }
        if shown.len() > count {
            let visible = self.visible_fractions(scene_id, im_id, objects.len())?;
            shown.sort_by(|&a, &b| visible[b].total_cmp(&visible[a]));
            shown.truncate(count);
        }
        Ok(shown.into_iter().map(|k| objects[k].t_cam_model).collect())
    }
}
