//! How much of the true objects is visible.

use nalgebra::Isometry3;
use serde::Deserialize;

use super::error::DatasetError;
use super::ground_truth::GroundTruth;

#[derive(Deserialize)]
struct VisibilityEntry {
    visib_fract: f64,
}

impl GroundTruth<'_> {
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
    /// Those of [`GroundTruth::objects`], [`DatasetError::Field`] if the image shows fewer, and those of
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
