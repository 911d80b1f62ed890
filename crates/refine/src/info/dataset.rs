//! Datasets.

use std::collections::BTreeSet;
use std::fmt;
use std::fs;
use std::path::Path;

use prehend_render::RgbImage;
use serde::Serialize;

use super::InfoError;
use super::lines::{line, listed};
use crate::check::likely_unit;
use crate::data::bop::{Dataset, DatasetError, Scene};
use crate::data::load_mesh;
use crate::symmetry::Symmetries;

/// One split of a dataset.
#[derive(Clone, Debug, Serialize)]
pub struct DatasetInfo {
    /// The split's name.
    pub split: String,
    /// Its scenes.
    pub scenes: Vec<SceneInfo>,
    /// Ids of the objects that there are models of.
    pub objects: Vec<u32>,
    /// Objects whose mass is known.
    pub masses: usize,
    /// Objects of which symmetries are known.
    pub symmetric: usize,
    /// Columns and rows of the first image.
    pub image_size: Option<[usize; 2]>,
}

/// A scene, and how many of its images have what.
#[derive(Clone, Debug, Serialize)]
pub struct SceneInfo {
    /// Its id.
    pub id: u32,
    /// Its images.
    pub images: usize,
    /// Images with color.
    pub color: usize,
    /// Images with depth.
    pub depth: usize,
    /// Images with a mask.
    pub masks: usize,
    /// Images in which the hand is known.
    pub hand: usize,
    /// Images with taxel forces.
    pub touch: usize,
    /// Whether there are true poses.
    pub truth: bool,
}

impl DatasetInfo {
    pub(super) fn read(
        path: &Path,
        split: Option<&str>,
        warnings: &mut Vec<String>,
    ) -> Result<Self, InfoError> {
        let dataset = match split {
            Some(split) => Dataset::open_split(path, split)?,
            None => Dataset::open(path)?,
        };
        let mut scenes = Vec::new();
        for scene in dataset.scenes() {
            match SceneInfo::read(&dataset, scene, warnings) {
                Ok(info) => scenes.push(info),
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
        Ok(Self {
            split: dataset.split_dir().file_name().unwrap_or_default().display().to_string(),
            image_size: image_size(&dataset),
            masses: infos.iter().filter(|info| info.mass.is_some()).count(),
            symmetric: infos.iter().filter(|info| info.symmetries != Symmetries::default()).count(),
            scenes,
            objects,
        })
    }
}

/// The size of the first image that can be read.
fn image_size(dataset: &Dataset) -> Option<[usize; 2]> {
    let scene = dataset.scenes().next()?;
    let frame = dataset.frame(scene.id(), *scene.images().ok()?.first()?).ok()?;
    let image = RgbImage::load(&frame.rgb_path().ok()?).ok()?;
    Some([image.width(), image.height()])
}

impl SceneInfo {
    fn read(
        dataset: &Dataset,
        scene: &Scene,
        warnings: &mut Vec<String>,
    ) -> Result<Self, DatasetError> {
        let images = scene.images()?;
        let count = |folder: &str| {
            let there = numbered(&scene.dir().join(folder));
            images.iter().filter(|image| there.contains(image)).count()
        };
        let mut info = Self {
            id: scene.id(),
            images: images.len(),
            color: count("rgb"),
            depth: count("depth"),
            masks: count("mask_visib"),
            hand: 0,
            touch: 0,
            truth: scene.dir().join("scene_gt.json").is_file(),
        };
        let mut faults = BTreeSet::new();
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
                Err(DatasetError::Missing { .. } | DatasetError::NoEntry { .. }) => 0,
                Err(error) => {
                    faults.insert(error.to_string());
                    0
                }
            };
            info.hand += known(frame.bodies().map(|_| ()));
            info.touch += known(frame.tactile().map(|_| ()));
        }
        warnings.extend(faults);
        Ok(info)
    }
}

/// The numbers that names of files in a folder begin with; none where it cannot be listed.
fn numbered(folder: &Path) -> BTreeSet<u32> {
    let listing = fs::read_dir(folder).into_iter().flatten().flatten();
    let number = |name: &str| name.split(['_', '.']).next()?.parse().ok();
    listing.filter_map(|file| number(file.file_name().to_str()?)).collect()
}

impl fmt::Display for DatasetInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scenes, objects, masses, symmetric, .. } = self;
        line(f, "split", &self.split)?;
        let images: usize = scenes.iter().map(|scene| scene.images).sum();
        let size = self.image_size.map(|[w, h]| format!(", the first of {w}x{h} pixels"));
        line(f, "images", format!("{images}{}", size.unwrap_or_default()))?;
        line(f, "objects", listed(objects))?;
        line(f, "of known mass", format!("{masses} of {}", objects.len()))?;
        line(f, "with symmetries", format!("{symmetric} of {}", objects.len()))?;
        line(f, "scenes", scenes.len())?;
        for SceneInfo { id, images, color, depth, masks, hand, touch, truth } in scenes {
            let truth = if *truth { "with" } else { "no" };
            writeln!(
                f,
                "    {id}: {images} images, {color} with color, {depth} depth, {masks} masks, {hand} hand, {touch} touch; {truth} \
                 ground truth"
            )?;
        }
        Ok(())
    }
}
