//! Targets: the objects to be localized, by image.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use crate::data::bop::{Dataset, DatasetError, read_json};
use crate::scene::Target;

/// BOP's list of targets, in the dataset's folder.
const LIST: &str = "test_targets_bop19.json";
/// More instances of one object than any image shows.
const MOST_INSTANCES: usize = 1000;

/// The layout of a list's entries.
#[derive(Deserialize)]
struct Listed {
    scene_id: u32,
    im_id: u32,
    obj_id: u32,
    inst_count: Option<usize>,
}

/// The targets that `file` lists, in the layout of BOP's `test_targets_bop19.json`; without `file`, those of that
/// list of the dataset; and without such a list, the only object that there is a model of, once in each image.
///
/// # Errors
/// If a file is missing or broken, or there is no list and not just one object.
pub fn find_targets(dataset: &Dataset, file: Option<&Path>) -> Result<Vec<Target>, DatasetError> {
    if let Some(listed) = listed_targets(dataset, file)? {
        return Ok(listed);
    }
    let [obj_id] = dataset.models().object_ids()?[..] else {
        let problem = "no list of targets (--targets names one), and there is not just one object";
        return Err(DatasetError::unusable(&dataset.root().join(LIST), problem));
    };
    let mut targets = Vec::new();
    for scene in dataset.scenes() {
        let of_image = |im_id| Target { scene_id: scene.id(), im_id, obj_id, instance: 0 };
        targets.extend(scene.images()?.into_iter().map(of_image));
    }
    Ok(targets)
}

/// The targets that `file` lists or, without `file`, the dataset's own list; `None` if it has none.
///
/// # Errors
/// If a file is missing or broken.
pub(crate) fn listed_targets(
    dataset: &Dataset,
    file: Option<&Path>,
) -> Result<Option<Vec<Target>>, DatasetError> {
    let own = dataset.root().join(LIST);
    file.or_else(|| own.is_file().then_some(own.as_path())).map(read).transpose()
}

fn read(file: &Path) -> Result<Vec<Target>, DatasetError> {
    let listed: Vec<Listed> = read_json(file)?;
    let mut targets = Vec::new();
    let mut in_image: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    for Listed { scene_id, im_id, obj_id, inst_count } in listed {
        let count = inst_count.unwrap_or(1);
        if count > MOST_INSTANCES {
            let problem = format!("scene {scene_id} image {im_id}: inst_count is {count}");
            return Err(DatasetError::unusable(file, problem));
        }
        let next = in_image.entry((scene_id, im_id)).or_default();
        for _ in 0..count {
            targets.push(Target { scene_id, im_id, obj_id, instance: *next });
            *next += 1;
        }
    }
    Ok(targets)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn instances_are_counted_by_image_and_faults_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("list.json");
        let text = r#"[{"scene_id": 1, "im_id": 2, "obj_id": 7, "inst_count": 2},
            {"scene_id": 1, "im_id": 3, "obj_id": 7}, {"scene_id": 1, "im_id": 2, "obj_id": 9}]"#;
        fs::write(&file, text).unwrap();
        let found: Vec<_> =
            read(&file).unwrap().iter().map(|t| (t.im_id, t.obj_id, t.instance)).collect();
        assert_eq!(found, [(2, 7, 0), (2, 7, 1), (3, 7, 0), (2, 9, 2)]);

        let refused = |text: &str| {
            fs::write(&file, text).unwrap();
            read(&file).unwrap_err().to_string()
        };
        assert!(refused("[{\"scene_id\": 1}]").contains("list.json: [0]: missing field `im_id`"));
        assert!(refused("{").contains("list.json"));
        let many = r#"[{"scene_id": 1, "im_id": 2, "obj_id": 7, "inst_count": 4000000000}]"#;
        assert!(refused(many).contains("inst_count is 4000000000"));
        assert!(matches!(read(dir.path().join("no").as_path()), Err(DatasetError::Missing { .. })));
    }
}
