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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bop::{Dataset, GroundTruth, read_results};
    use crate::synth::default_scene;
    use crate::{Assets, TermKind};
    use nalgebra::Isometry3;

    fn near(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
        (a.translation.vector - b.translation.vector).norm() < 1e-12
            && a.rotation.angle_to(&b.rotation) < 1e-12
    }

    #[test]
    fn what_is_written_reads_back() {
        let dir = tempfile::tempdir().unwrap();
        let scene = default_scene(3).unwrap();
        write_dataset(dir.path(), std::slice::from_ref(&scene)).unwrap();
        let dataset = Dataset::open(dir.path()).unwrap();
        let mut assets = Assets::new(&dataset, 0);
        let frame = dataset.frame(1, 0).unwrap();
        let (seen, robot) = assets.observation(&frame, 0, &TermKind::ALL).unwrap();
        let given = &scene.observation;
        assert_eq!((seen.camera, &seen.mask), (given.camera, &given.mask));
        assert!(seen.gravity.unwrap().metric_distance(&given.gravity.unwrap()) < 1e-12);
        // Half a unit of 8 bits and of 0.1 mm.
        let pixels = seen.color.pixels().iter().zip(given.color.pixels());
        assert!(pixels.flat_map(|(a, b)| [0, 1, 2].map(|c| a[c] - b[c])).all(|d| d.abs() < 2.1e-3));
        let depths = seen.depth.pixels().iter().zip(given.depth.pixels());
        assert!(depths.clone().all(|(a, b)| (a - b).abs() < 5.1e-5));
        assert!(depths.filter(|(a, _)| **a > 0.0).count() > 1000);

        let (hand, told) = (given.hand.as_ref().unwrap(), seen.hand.unwrap());
        assert!(near(&told.t_cam_hand, &hand.t_cam_hand));
        assert_eq!(told.joints, hand.joints);
        let forces = told.forces.iter().zip(&hand.forces);
        assert!(forces.clone().any(|(a, _)| a.norm() > 0.1));
        assert!(forces.clone().all(|(a, b)| {
            let clipped = b.map(|v| v.clamp(-10.0, 10.0));
            a.metric_distance(&clipped) < 1e-12
        }));
        assert_eq!(robot.unwrap().taxels.len(), scene.robot.taxels.len());

        let object = assets.object(scene.obj_id).unwrap();
        assert!(!object.inertial_assumed);
        assert!((object.inertial.mass - scene.object.inertial.mass).abs() < 1e-15);
        let inertia = (object.inertial.inertia - scene.object.inertial.inertia).amax();
        assert!(inertia < 1e-12 && object.mesh.texture.is_some(), "{inertia}");
        let vertices = object.mesh.vertices.iter().zip(&scene.object.mesh.vertices);
        assert!(vertices.clone().all(|(a, b)| nalgebra::distance(a, b) < 1e-12));

        let truth = GroundTruth::new(&dataset);
        assert!(truth.models().dir().ends_with("models_eval"));
        assert!(near(&truth.pose(1, 0, scene.obj_id, &scene.initial).unwrap(), &scene.truth));
        let visible = truth.visible_fractions(1, 0).unwrap().unwrap();
        assert!(visible.len() == 1 && visible[0] > 0.5 && visible[0] < 1.0, "{visible:?}");
        let diameter = truth.models().info(scene.obj_id).unwrap().diameter;
        assert!((0.19..0.2).contains(&diameter), "{diameter}");
        let rows = read_results(&dir.path().join("init.csv")).unwrap().rows;
        assert!(rows.len() == 1 && near(&rows[0].t_cam_model, &scene.initial));
        let whole = dir.path().join("test/000001/mask/000000_000000.png");
        let hidden = Mask::load(&whole).unwrap();
        let seen = given.mask.pixels().iter().zip(hidden.pixels());
        assert!(seen.filter(|(visible, whole)| **visible && !**whole).count() < 50);
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("file");
        fs::write(&file, "").unwrap();
        let error = write_dataset(&file, &[]).unwrap_err().to_string();
        assert!(error.contains("file/test") && error.contains("cannot be written"), "{error}");
    }
}
