//! What is to be localized, and how well it was.

use std::collections::BTreeMap;
use std::path::Path;

use super::matching::Found;
use crate::data::bop::{Dataset, DatasetError, GroundTruth};
use crate::data::listed_targets;

/// Objects of which less than this is visible are no targets, in datasets that list none.
const LEAST_VISIBLE: f64 = 0.1;

/// An object to be localized in one image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LocalizationTarget {
    /// Scene of the split.
    pub scene_id: u32,
    /// Image of the scene.
    pub im_id: u32,
    /// The object.
    pub obj_id: u32,
    /// How many instances of it are to be found: the most visible ones.
    pub instances: usize,
}

/// How often the instances of one target were found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TargetScore {
    /// The target.
    pub target: LocalizationTarget,
    /// Number of estimates that count, at most one an instance.
    pub estimates: usize,
    pub(super) found: Found,
    /// True where depth was measured.
    pub(super) has_depth: bool,
}

/// The targets that `file` lists; without `file` those that the dataset lists, and without such a list all objects of which
/// enough is visible.
pub(super) fn localization_targets(
    dataset: &Dataset,
    truth: &GroundTruth,
    file: Option<&Path>,
) -> Result<Vec<LocalizationTarget>, DatasetError> {
    let mut instances: BTreeMap<(u32, u32, u32), usize> = BTreeMap::new();
    if let Some(listed) = listed_targets(dataset, file)? {
        for target in listed {
            *instances.entry((target.scene_id, target.im_id, target.obj_id)).or_default() += 1;
        }
    } else {
        for scene in dataset.scenes() {
            for im_id in scene.images()? {
                let objects = truth.objects(scene.id(), im_id)?;
                let visible = truth.visible_fractions(scene.id(), im_id, objects.len())?;
                for (object, _) in objects.iter().zip(visible).filter(|(_, v)| *v >= LEAST_VISIBLE)
                {
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
