//! Scenes as a BOP dataset with this project's extensions.

use std::collections::BTreeMap;
use std::path::Path;

use prehend_render::{Mask, depth_map};

use super::files::{FRAME_FOLDERS, Shot, write_entries, write_models};
use super::hand_files::HandFiles;
use crate::data::AssetError;
use crate::data::bop::{ResultRow, create_folder, write_results};
use crate::scene::Scene;

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
    for folder in FRAME_FOLDERS.map(|name| scene_dir.join(name)) {
        create_folder(&folder)?;
    }
    let mut frames = BTreeMap::new();
    let mut objects = BTreeMap::new();
    let mut rows = Vec::new();
    for (im_id, scene) in (0_u32..).zip(scenes) {
        let seen = &scene.frame;
        let shot = Shot {
            told: seen.clone(),
            lens: None,
            truth: scene.truth,
            // Nothing else is known of these hands, and where they are is where the world is.
            hand: None,
            world: seen.hand.as_ref().map(|hand| hand.t_cam_hand),
            whole: silhouette(scene),
            visible: seen.mask.clone(),
        };
        let obj_id = scene.obj_id;
        let entries = shot.write(&scene_dir, im_id, obj_id, 0)?;
        frames.insert(im_id as usize, entries);
        objects.insert(obj_id, &scene.object);
        let (scene_id, t_cam_model) = (SCENE_ID, scene.initial);
        rows.push(ResultRow { scene_id, im_id, obj_id, score: 1.0, t_cam_model, time: -1.0 });
    }
    write_entries(&scene_dir, &frames)?;
    for folder in ["models", "models_eval"] {
        let models = objects.iter().map(|(id, o)| (*id, o.mesh.clone(), &o.inertial));
        write_models(&dir.join(folder), models)?;
    }
    if let Some(scene) = scenes.first() {
        let (robot, urdf) = (scene.hand.clone(), scene.urdf.clone());
        HandFiles { robot, urdf, meshes: Vec::new() }.write(dir)?;
    }
    Ok(write_results(&dir.join("init.csv"), &rows)?)
}

/// The object's whole silhouette.
fn silhouette(scene: &Scene) -> Mask {
    let rendered = depth_map(&scene.frame.camera, &[(&scene.object.model, scene.truth)]);
    let mut whole = Mask::filled(rendered.width(), rendered.height(), false);
    for (set, &z) in whole.pixels_mut().iter_mut().zip(rendered.pixels()) {
        *set = z > 0.0;
    }
    whole
}
