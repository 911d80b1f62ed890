//! The files of a dataset in the making: folders, images, one entry an image in each JSON file of a scene, and models.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use nalgebra::Isometry3;
use prehend_geometry::TriMesh;
use prehend_render::{Distortion, Mask};
use serde_json::{Map, Value};

use super::annotation::{self, ImageEntries};
use crate::data::AssetError;
use crate::data::bop::{DatasetError, create_folder, write_atomically};
use crate::scene::{Frame, Inertial};

/// Removes what was being written in the folder and below when a process ended: such files are hidden and end in `.tmp`.
pub(super) fn remove_temporary(folder: &Path) -> Result<(), DatasetError> {
    let entries = fs::read_dir(folder).map_err(|e| DatasetError::reading(folder, &e))?;
    for entry in entries.flatten() {
        let (file, name) = (entry.path(), entry.file_name());
        let name = name.to_string_lossy();
        if entry.file_type().is_ok_and(|t| t.is_dir()) {
            remove_temporary(&file)?;
        } else if name.starts_with('.') && name.ends_with(".tmp") {
            let removed = fs::remove_file(&file);
            removed.map_err(|e| DatasetError::writing(&file, e))?;
        }
    }
    Ok(())
}

/// The folders of a scene.
pub(super) const FRAME_FOLDERS: [&str; 4] = ["rgb", "depth", "mask", "mask_visib"];

/// One frame: what is measured, and what is true.
pub(super) struct Shot {
    /// The observation as the estimator gets it, but for the lens.
    pub(super) told: Frame,
    /// The lens that the images are seen through, if it is no pinhole.
    pub(super) lens: Option<Distortion>,
    /// Object → camera.
    pub(super) truth: Isometry3<f64>,
    /// Hand base → camera and joint positions, where the dataset keeps them apart from the measured ones.
    pub(super) hand: Option<(Isometry3<f64>, Vec<f64>)>,
    /// World → camera, where there is a world.
    pub(super) world: Option<Isometry3<f64>>,
    /// The object's silhouette, as far as it lies within the image.
    pub(super) whole: Mask,
    /// The part of it that nothing hides.
    pub(super) visible: Mask,
}

impl Shot {
    /// Writes the images to the scene's folders, color as JPEG of that quality or, if that is 0, as PNG; returns what they
    /// add to the files of the scene.
    ///
    /// # Errors
    /// When one cannot be written; those before it are there then.
    pub(super) fn write(
        &self,
        scene_dir: &Path,
        im_id: u32,
        obj_id: u32,
        jpeg_quality: u8,
    ) -> Result<ImageEntries, AssetError> {
        let (image, instance) = (format!("{im_id:06}.png"), format!("{im_id:06}_000000.png"));
        let unit = annotation::DEPTH_SCALE * 1e-3;
        let rgb = scene_dir.join("rgb").join(&image);
        match jpeg_quality {
            0 => self.told.color.save(&rgb),
            quality => self.told.color.save_jpeg(&rgb.with_extension("jpg"), quality),
        }
        .map_err(DatasetError::from)?;
        let depth = scene_dir.join("depth").join(&image);
        self.told.depth.save(&depth, unit).map_err(DatasetError::from)?;
        let mask = |folder: &str, mask: &Mask| {
            mask.save(&scene_dir.join(folder).join(&instance)).map_err(DatasetError::from)
        };
        mask("mask_visib", &self.told.mask)?;
        mask("mask", &self.whole)?;
        Ok(self.entries(obj_id))
    }
}

/// The files that have an entry for each image. The camera's comes last: a scene that has it has all.
pub(super) const NAMES: [&str; 6] = [
    "scene_gt.json",
    "scene_gt_info.json",
    "scene_bodies.json",
    "scene_bodies_gt.json",
    "scene_tactile.json",
    "scene_camera.json",
];

/// Writes those of the scene's files that have entries, with one line an image as BOP's own tools write them; each of them
/// whole or not at all.
///
/// # Errors
/// When one cannot be written.
pub(super) fn write_entries(
    scene_dir: &Path,
    frames: &BTreeMap<usize, ImageEntries>,
) -> Result<(), DatasetError> {
    for name in NAMES {
        let line = |(im_id, entries): (&usize, &ImageEntries)| {
            entries.get(name).map(|entry| format!("  \"{im_id}\": {entry}"))
        };
        let lines: Vec<String> = frames.iter().filter_map(line).collect();
        if !lines.is_empty() {
            let text = format!("{{\n{}\n}}\n", lines.join(",\n"));
            write_atomically(&scene_dir.join(name), text.as_bytes())?;
        }
    }
    Ok(())
}

/// Writes `obj_*.ply` in millimeters, with textures beside them, and `models_info.json` to the folder `dir`.
///
/// # Errors
/// When a file cannot be written.
pub(super) fn write_models<'a>(
    dir: &Path,
    models: impl Iterator<Item = (u32, TriMesh, &'a Inertial)>,
) -> Result<(), AssetError> {
    create_folder(dir)?;
    let mut info = Map::new();
    for (id, mesh, inertial) in models {
        info.insert(id.to_string(), annotation::model(&mesh, inertial));
        mesh.scaled(1e3).save_ply(&dir.join(format!("obj_{id:06}.ply")))?;
    }
    let text = format!("{:#}\n", Value::Object(info));
    Ok(write_atomically(&dir.join("models_info.json"), text.as_bytes())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_json_with_a_line_an_image() {
        let dir = tempfile::tempdir().unwrap();
        let gt = ("scene_gt.json".to_owned(), serde_json::json!([{ "a": 1 }]));
        let entries = ImageEntries::from_iter([gt]);
        let frames = BTreeMap::from([(9, entries.clone()), (10, entries)]);
        write_entries(dir.path(), &frames).unwrap();
        let text = fs::read_to_string(dir.path().join("scene_gt.json")).unwrap();
        assert_eq!(text, "{\n  \"9\": [{\"a\":1}],\n  \"10\": [{\"a\":1}]\n}\n");
        assert!(!dir.path().join("scene_tactile.json").exists());
    }
}
