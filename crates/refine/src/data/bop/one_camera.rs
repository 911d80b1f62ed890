//! Scenes of which nothing is said but by `camera.json`: one camera took all images.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde::Deserialize;
use serde_json::json;
use serde_json::value::to_raw_value;

use super::json::{JsonFile, UniqueMap, read_json};
use super::numbers::{Positive, Real};

/// The camera of BOP's `camera.json`.
#[derive(Deserialize)]
struct CameraFile {
    fx: Positive,
    fy: Positive,
    cx: Real,
    cy: Real,
    depth_scale: Option<Positive>,
}

/// The file `scene_camera.json` of the scene in `dir`; where there is none but the dataset's `camera` gives intrinsics, with an entry of those for each image
/// in `rgb/`, or else in `depth/`.
pub(super) fn scene_camera(dir: &Path, camera: &JsonFile) -> JsonFile {
    let path = dir.join("scene_camera.json");
    if path.exists() {
        return JsonFile::new(path);
    }
    let Ok(CameraFile { fx, fy, cx, cy, depth_scale }) = read_json(camera.path()) else {
        // What is missing then is scene_camera.json.
        return JsonFile::new(path);
    };
    let k = [fx.0, 0.0, cx.0, 0.0, fy.0, cy.0, 0.0, 0.0, 1.0];
    let entry = json!({ "cam_K": k, "depth_scale": depth_scale.map_or(1.0, |scale| scale.0) });
    let images = ["rgb", "depth"].map(|folder| image_ids(&dir.join(folder)));
    let images = images.into_iter().find(|ids| !ids.is_empty()).unwrap_or_default();
    let named = |id: u32| Some((id.to_string(), to_raw_value(&entry).ok()?));
    JsonFile::with_entries(path, UniqueMap(images.into_iter().filter_map(named).collect()))
}

/// Numbers that are names of files in `folder`.
fn image_ids(folder: &Path) -> BTreeSet<u32> {
    let files = fs::read_dir(folder).into_iter().flatten().flatten();
    files.filter_map(|file| file.path().file_stem()?.to_str()?.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use crate::data::bop::Dataset;

    #[test]
    fn one_camera_serves_all_images() {
        let dir = tempfile::tempdir().unwrap();
        let scene = dir.path().join("test/000002");
        fs::create_dir_all(scene.join("rgb")).unwrap();
        for name in ["000003.jpg", "000010.jpg", "notes.txt"] {
            fs::write(scene.join("rgb").join(name), "").unwrap();
        }
        let camera = dir.path().join("camera.json");
        let open = || Dataset::open(dir.path()).unwrap();
        let missing = |dataset: &Dataset| dataset.frame(2, 3).unwrap_err().to_string();
        assert!(missing(&open()).contains("scene_camera.json: no such file"));
        fs::write(&camera, r#"{"cx": 325.3, "cy": 242.0, "depth_scale": 0.5, "fx": 572.4, "fy": 573.6, "height": 480, "width": 640}"#).unwrap();
        let dataset = open();
        assert_eq!(dataset.scene(2).unwrap().images().unwrap(), [3, 10]);
        let frame = dataset.frame(2, 10).unwrap();
        let camera_of = frame.camera(640, 480);
        assert_eq!((camera_of.fx, camera_of.cy, frame.depth_scale), (572.4, 242.0, 0.5));
        assert!(
            missing(&{
                fs::write(&camera, "{\"fx\": 1}").unwrap();
                open()
            })
            .contains("scene_camera.json")
        );
    }
}
