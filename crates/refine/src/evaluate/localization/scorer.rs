//! Scoring targets of a dataset.

use std::collections::HashMap;
use std::path::Path;

use prehend_render::{Camera, DepthImage};

use super::matching::Found;
use super::target::{LocalizationTarget, TargetScore, localization_targets};
use crate::data::bop::{Dataset, DatasetError, GroundTruth, ResultRow};
use crate::data::{AssetError, load_mesh};
use crate::evaluate::metrics::NormalizedErrors;
use crate::evaluate::model::EvaluationModel;

/// Scores estimates for targets of one dataset.
pub struct LocalizationScorer<'a> {
    dataset: &'a Dataset,
    truth: GroundTruth<'a>,
    models: HashMap<u32, EvaluationModel>,
    /// That of the target scored last: targets come image by image.
    image: Option<Image>,
}

/// What scoring needs of one image.
struct Image {
    scene_and_image: (u32, u32),
    camera: Camera,
    /// What was measured, in scenes with depth.
    depth: Option<DepthImage>,
}

impl<'a> LocalizationScorer<'a> {
    /// A scorer of targets of the split that `dataset` shows.
    pub fn new(dataset: &'a Dataset) -> Self {
        let truth = GroundTruth::new(dataset);
        Self { dataset, truth, models: HashMap::new(), image: None }
    }

    /// The targets that `file` lists, in the layout of BOP's `test_targets_bop19.json`; without `file`, those of that list of
    /// the dataset; and without such a list, all true objects of which a tenth is visible. Ordered by scene, image and object.
    ///
    /// # Errors
    /// If a file is missing or broken.
    pub fn targets(&self, file: Option<&Path>) -> Result<Vec<LocalizationTarget>, DatasetError> {
        localization_targets(self.dataset, &self.truth, file)
    }

    /// How well those of `rows` that are of `target` localize it. Of rows of equal score, the first counts.
    ///
    /// # Errors
    /// If a file that scoring needs is missing or broken (depth in a scene that has some, ground truth, `models_info.json`), or the image shows
    /// fewer instances than the target has.
    pub fn score(
        &mut self,
        target: &LocalizationTarget,
        rows: &[ResultRow],
    ) -> Result<TargetScore, AssetError> {
        let LocalizationTarget { scene_id, im_id, obj_id, instances } = *target;
        let truths = self.truth.most_visible(scene_id, im_id, obj_id, instances)?;
        let of_target =
            |row: &&ResultRow| (row.scene_id, row.im_id, row.obj_id) == (scene_id, im_id, obj_id);
        let mut estimates: Vec<&ResultRow> = rows.iter().filter(of_target).collect();
        estimates.sort_by(|a, b| b.score.total_cmp(&a.score));
        estimates.truncate(instances);
        let mut errors: Vec<Vec<NormalizedErrors>> = Vec::new();
        if !estimates.is_empty() {
            self.prepare_model(obj_id)?;
            let image = match self.image.take() {
                Some(image) if image.scene_and_image == (scene_id, im_id) => image,
                _ => self.read_image(scene_id, im_id)?,
            };
            let Image { camera, depth, .. } = self.image.insert(image);
            let model = &self.models[&obj_id];
            let against_all = |estimate: &&ResultRow| {
                let error =
                    |truth| model.errors(&estimate.t_cam_model, truth, camera, depth.as_ref());
                truths.iter().map(error).collect()
            };
            errors = estimates.iter().map(against_all).collect();
        }
        let found = Found::new(&errors);
        let has_depth = self.has_depth(target);
        Ok(TargetScore { target: *target, estimates: estimates.len(), found, has_depth })
    }

    fn prepare_model(&mut self, obj_id: u32) -> Result<(), AssetError> {
        if !self.models.contains_key(&obj_id) {
            let models = self.truth.models();
            // Recalls of an object whose symmetries are not known could not be compared.
            models.info(obj_id)?;
            let mesh = load_mesh(models, obj_id)?;
            let model = EvaluationModel::new(models, obj_id, mesh)?;
            self.models.insert(obj_id, model);
        }
        Ok(())
    }

    fn read_image(&self, scene_id: u32, im_id: u32) -> Result<Image, DatasetError> {
        let frame = self.dataset.frame(scene_id, im_id)?;
        let depth = frame.has_depth().then(|| frame.depth()).transpose()?;
        let (width, height) = match &depth {
            Some(depth) => (depth.width(), depth.height()),
            None => frame.image_size()?,
        };
        let camera = frame.camera(width, height);
        Ok(Image { scene_and_image: (scene_id, im_id), camera, depth })
    }

    /// True of a target in a scene whose depth was measured, which VSD compares with.
    fn has_depth(&self, target: &LocalizationTarget) -> bool {
        let frame = self.dataset.frame(target.scene_id, target.im_id);
        frame.is_ok_and(|frame| frame.has_depth())
    }
}
