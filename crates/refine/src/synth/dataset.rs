//! Scenes as a BOP dataset with this project's extensions.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use prehend_geometry::hand::Taxel;
use prehend_render::{Mask, depth_map};
use serde_json::{Map, Value};

use super::{Scene, annotation};
use crate::bop::{DatasetError, ResultRow, write_atomically, write_results};
use crate::{AssetError, Object};

/// The hand's files, relative to the dataset.
const URDF: &str = "hand/hand.urdf";
const TAXELS: &str = "hand/taxels.csv";
/// The only scene.
const SCENE_ID: u32 = 1;

/// Writes `scenes` to the folder `dir`, made if absent, as images 0, 1, … of scene 1 of the split `test`.
///
/// Beside BOP's own files (`rgb/`, `depth/` of 0.1 mm, `mask/`, `mask_visib/`, `scene_camera.json`,
/// `scene_gt.json`, `scene_gt_info.json`, `models/`, `models_eval/`) it has those that say where the hand
/// is and what it feels (`scene_bodies.json`, `scene_tactile.json`, `hand/`), and the initial poses in
/// `init.csv`. All scenes must be of the same hand; objects of the same `obj_id` must be the same.
///
/// # Errors
/// If a file cannot be written; files of the same names are replaced.
pub fn write_dataset(dir: &Path, scenes: &[Scene]) -> Result<(), AssetError> {
    let scene_dir = dir.join("test").join(format!("{SCENE_ID:06}"));
    for folder in ["rgb", "depth", "mask", "mask_visib"].map(|name| scene_dir.join(name)) {
        make(&folder)?;
    }
    let mut files: BTreeMap<&str, Map<String, Value>> = BTreeMap::new();
    let mut objects: BTreeMap<u32, &Object> = BTreeMap::new();
    let mut rows = Vec::new();
    for (im_id, scene) in (0_u32..).zip(scenes) {
        let whole = write_images(&scene_dir, im_id, scene)?;
        let mut annotate = |file, entry| {
            files.entry(file).or_default().insert(im_id.to_string(), entry);
        };
        annotate("scene_camera.json", annotation::camera(scene));
        annotate("scene_gt.json", annotation::truth(scene));
        annotate("scene_gt_info.json", annotation::visibility(scene, &whole));
        if let Some(hand) = &scene.observation.hand {
            annotate("scene_bodies.json", annotation::bodies(scene, hand, URDF));
            annotate("scene_tactile.json", annotation::touch(hand, TAXELS));
        }
        objects.insert(scene.obj_id, &scene.object);
        rows.push(ResultRow {
            scene_id: SCENE_ID,
            im_id,
            obj_id: scene.obj_id,
            score: 1.0,
            t_cam_model: scene.initial,
            time: -1.0,
        });
    }
    for (name, entries) in files {
        write_json(&scene_dir.join(name), entries)?;
    }
    for folder in ["models", "models_eval"].map(|name| dir.join(name)) {
        write_models(&folder, &objects)?;
    }
    if let Some(scene) = scenes.first() {
        make(&dir.join("hand"))?;
        write_atomically(&dir.join(URDF), scene.urdf.as_bytes())?;
        write_atomically(&dir.join(TAXELS), taxel_table(&scene.robot.taxels).as_bytes())?;
    }
    Ok(write_results(&dir.join("init.csv"), &rows)?)
}

/// Writes the images of a scene and returns the object's whole silhouette.
fn write_images(dir: &Path, im_id: u32, scene: &Scene) -> Result<Mask, AssetError> {
    let seen = &scene.observation;
    let rendered = depth_map(&seen.camera, &[(&scene.object.model, scene.truth)]);
    let mut whole = Mask::filled(rendered.width(), rendered.height(), false);
    for (set, &z) in whole.pixels_mut().iter_mut().zip(rendered.pixels()) {
        *set = z > 0.0;
    }
    let (image, instance) = (format!("{im_id:06}.png"), format!("{im_id:06}_000000.png"));
    let unit = annotation::DEPTH_SCALE * 1e-3;
    seen.color.save(&dir.join("rgb").join(&image)).map_err(DatasetError::from)?;
    seen.depth.save(&dir.join("depth").join(&image), unit).map_err(DatasetError::from)?;
    seen.mask.save(&dir.join("mask_visib").join(&instance)).map_err(DatasetError::from)?;
    whole.save(&dir.join("mask").join(&instance)).map_err(DatasetError::from)?;
    Ok(whole)
}

fn write_models(dir: &Path, objects: &BTreeMap<u32, &Object>) -> Result<(), AssetError> {
    make(dir)?;
    let mut info = Map::new();
    for (id, object) in objects {
        object.mesh.clone().scaled(1e3).save_ply(&dir.join(format!("obj_{id:06}.ply")))?;
        info.insert(id.to_string(), annotation::model(object));
    }
    write_json(&dir.join("models_info.json"), info)
}

fn write_json(file: &Path, entries: Map<String, Value>) -> Result<(), AssetError> {
    Ok(write_atomically(file, format!("{:#}\n", Value::Object(entries)).as_bytes())?)
}

/// The columns that [`prehend_geometry::hand::load_taxels`] reads.
fn taxel_table(taxels: &[Taxel]) -> String {
    let mut text = "idx,patch,link,x_m,y_m,z_m,nx,ny,nz\n".to_owned();
    for Taxel { index, patch, link, position: p, normal: n } in taxels {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{index},{patch},{link},{},{},{},{},{},{}",
            p.x, p.y, p.z, n.x, n.y, n.z
        );
    }
    text
}

fn make(folder: &Path) -> Result<(), DatasetError> {
    let problem = |e: std::io::Error| e.to_string();
    fs::create_dir_all(folder)
        .map_err(|e| DatasetError::Write { file: folder.to_owned(), problem: problem(e) })
}
