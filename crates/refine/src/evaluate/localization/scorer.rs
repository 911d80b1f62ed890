//! Scoring targets of a dataset.

use std::collections::BTreeMap;
use std::path::Path;

use super::matching::count_found;
use super::target::{LocalizationTarget, TargetScore};
use crate::data::bop::{DatasetError, ResultRow};
use crate::data::{AssetError, listed_targets};
use crate::evaluate::metrics::NormalizedErrors;
use crate::evaluate::scoring::Scorer;

/// Objects of which less than this is visible are no targets, in datasets that list none.
const LEAST_VISIBLE: f64 = 0.1;

impl Scorer<'_> {
    /// The targets that `file` lists, in the layout of BOP's `test_targets_bop19.json`; without `file`, those of that list of
    /// the dataset; and without such a list, all true objects of which a tenth is visible. Ordered by scene, image and object.
    ///
    /// # Errors
    /// If a file is missing or broken.
    pub fn targets(&self, file: Option<&Path>) -> Result<Vec<LocalizationTarget>, DatasetError> {
        let mut instances: BTreeMap<(u32, u32, u32), usize> = BTreeMap::new();
        if let Some(listed) = listed_targets(self.dataset, file)? {
            for target in listed {
                *instances.entry((target.scene_id, target.im_id, target.obj_id)).or_default() += 1;
            }
        } else {
            for scene in self.dataset.scenes() {
                for im_id in scene.images()? {
                    let objects = self.truth.objects(scene.id(), im_id)?;
                    let visible = self.truth.visible_fractions(scene.id(), im_id, objects.len())?;
                    let seen = objects.iter().zip(visible).filter(|(_, v)| *v >= LEAST_VISIBLE);
                    for (object, _) in seen {
                        *instances.entry((scene.id(), im_id, object.obj_id)).or_default() += 1;
                    }
                }
            }
        }
        let target = |((scene_id, im_id, obj_id), instances)| LocalizationTarget {
            scene_id,
            im_id,
            obj_id,
            instances,
        };
        Ok(instances.into_iter().map(target).collect())
    }

    /// How well those of `rows` that are of `target` localize it. Of rows of equal score, the first counts.
    ///
    /// # Errors
    /// If a file that scoring needs is missing or broken (depth in a scene that has some, ground truth, `models_info.json`), or the image shows
    /// fewer instances than the target has.
    pub fn localize(
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
        let frame = self.dataset.frame(scene_id, im_id);
        let has_depth = frame.as_ref().is_ok_and(|frame| frame.has_depth());
        let mut errors: Vec<Vec<NormalizedErrors>> = Vec::new();
        if !estimates.is_empty() {
            // Recalls of an object whose symmetries are not known could not be compared.
            self.truth.models().info(obj_id)?;
            self.prepare_model(obj_id)?;
            let image = self.take_image(scene_id, im_id)?;
            let depth = self.image.insert(image).depth.as_ref();
            let frame = frame?;
            if depth.is_none() && has_depth {
                // It says what is wrong.
                frame.depth()?;
            }
            let (width, height) = match depth {
                Some(depth) => (depth.width(), depth.height()),
                None => frame.image_size()?,
            };
            let camera = frame.camera(width, height);
            let model = &self.models[&obj_id];
            let against_all = |estimate: &&ResultRow| {
                let error = |truth| model.errors(&estimate.t_cam_model, truth, &camera, depth);
                truths.iter().map(error).collect()
            };
            errors = estimates.iter().map(against_all).collect();
        }
        let found = count_found(&errors);
        Ok(TargetScore { target: *target, estimates: estimates.len(), found, has_depth })
    }
}
