//! Datasets.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use prehend_render::image_size;
use serde_json::{Value, json};

use crate::check::likely_unit;
use crate::data::bop::{Dataset, DatasetError, DatasetScene};
use crate::data::{AssetError, load_mesh};
use crate::symmetry::Symmetries;

/// Name of the split; scenes; ids of the objects that there are models of, and how many of them have a known mass, and symmetries; columns and rows of the first image.
pub(super) fn read(
    path: &Path,
    split: Option<&str>,
    warnings: &mut Vec<String>,
) -> Result<Value, AssetError> {
    let dataset = match split {
        Some(split) => Dataset::open_split(path, split)?,
        None => Dataset::open(path)?,
    };
    let mut scenes = Vec::new();
    for scene in dataset.scenes() {
        match of_scene(&dataset, scene, warnings) {
            Ok(fields) => scenes.push(fields),
            Err(error) => warnings.push(error.to_string()),
        }
    }
    let models = dataset.models();
    let objects = models.object_ids().unwrap_or_else(|error| {
        warnings.push(error.to_string());
        Vec::new()
    });
    let mut infos = Vec::new();
    for id in &objects {
        match load_mesh(models, *id) {
            Ok(mesh) => {
                let (low, high) = mesh.bounds().unwrap_or_default();
                let extent = (high - low).norm();
                warnings.extend(likely_unit(extent).map(|unit| {
                    format!("the mesh of object {id} is {extent:.4} m across: multiply its vertices by {unit} to have it in millimeters")
                }));
            }
            Err(error) => warnings.push(error.to_string()),
        }
        match models.info(*id) {
            Ok(info) => infos.push(info),
            Err(error) => warnings.push(error.to_string()),
        }
    }
    // One line says that there is no models_info.json.
    warnings.dedup();
    Ok(json!({
        "split": dataset.split_dir().file_name().unwrap_or_default().to_string_lossy(),
        "image_size": size_of_first(&dataset),
        "masses": infos.iter().filter(|info| info.mass.is_some()).count(),
        "symmetric": infos.iter().filter(|info| info.symmetries != Symmetries::default()).count(),
        "scenes": scenes,
        "objects": objects,
    }))
}

/// Columns and rows of the first image, if it can be read.
fn size_of_first(dataset: &Dataset) -> Option<[usize; 2]> {
    let scene = dataset.scenes().next()?;
    let frame = dataset.frame(scene.id(), *scene.images().ok()?.first()?).ok()?;
    image_size(&frame.rgb_path().ok()?).ok().map(<[usize; 2]>::from)
}

/// Id of a scene, number of its images, and of those with color, depth, a mask, a known hand and touch; whether there are true poses.
fn of_scene(
    dataset: &Dataset,
    scene: &DatasetScene,
    warnings: &mut Vec<String>,
) -> Result<Value, DatasetError> {
    let images = scene.images()?;
    let count = |folder: &Path| {
        let there = numbered(folder);
        images.iter().filter(|image| there.contains(image)).count()
    };
    let (mut hand, mut touch, mut faults) = (0, 0, BTreeSet::new());
    for &image in &images {
        let frame = match dataset.frame(scene.id(), image) {
            Ok(frame) => frame,
            Err(error) => {
                faults.insert(error.to_string());
                continue;
            }
        };
        let mut known = |found: Result<(), DatasetError>| match found {
            Ok(()) => 1,
            Err(DatasetError::Missing { .. }) => 0,
            Err(error) => {
                faults.insert(error.to_string());
                0
            }
        };
        hand += known(frame.bodies().map(drop));
        touch += known(frame.tactile().map(drop));
    }
    warnings.extend(faults);
    Ok(json!({
        "id": scene.id(),
        "images": images.len(),
        "color": count(&scene.color_dir()),
        "depth": count(&scene.dir().join("depth")),
        "masks": count(&scene.dir().join("mask_visib")),
        "hand": hand,
        "touch": touch,
        "truth": scene.dir().join("scene_gt.json").is_file(),
    }))
}

/// The numbers that names of files in a folder begin with; none where it cannot be listed.
fn numbered(folder: &Path) -> BTreeSet<u32> {
    let listing = fs::read_dir(folder).into_iter().flatten().flatten();
    let number = |name: &str| name.split(['_', '.']).next()?.parse().ok();
    listing.filter_map(|file| number(file.file_name().to_str()?)).collect()
}
