//! A BOP dataset as an estimator may see it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use serde::Deserialize;
use serde_json::json;
use serde_json::value::to_raw_value;

use super::error::DatasetError;
use super::files::names;
use super::json::{JsonFile, UniqueMap, read_json};
use super::models::Models;
use super::numbers::{Positive, Real};
use super::optics::SharedOptics;

/// One split of a BOP dataset, without anything that tells the true poses: neither `scene_gt*.json`,
/// `scene_bodies_gt.json`, `mask/` and `models_eval/`, nor the world poses of cameras are ever opened, but for images that a rig took together.
/// Those belong to [`super::GroundTruth`].
#[derive(Clone, Debug)]
pub struct Dataset {
    root: PathBuf,
    split_dir: PathBuf,
    scenes: Arc<BTreeMap<u32, DatasetScene>>,
    models: Arc<Models>,
    /// `camera.json`, which all cameras share.
    pub(super) camera: Arc<JsonFile>,
    /// Optics that the images of all scenes share.
    pub(super) optics: Arc<SharedOptics>,
}

/// One scene of a split; its files are read when first needed.
#[derive(Debug)]
pub struct DatasetScene {
    id: u32,
    dir: PathBuf,
    pub(super) camera: JsonFile,
    pub(super) bodies: JsonFile,
    pub(super) tactile: JsonFile,
    /// `scene_gt.json`; estimators may read the masks' objects alone.
    pub(super) objects: JsonFile,
    /// `scene_gt_info.json` and `scene_bodies_gt.json`, for [`super::GroundTruth`] alone.
    pub(super) visibility: JsonFile,
    pub(super) true_bodies: JsonFile,
    /// Images by the name of the rig that took them together.
    rigs: OnceLock<Result<BTreeMap<RigName, Vec<u32>>, DatasetError>>,
}

/// The name of a rig, which may be a number.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord)]
#[serde(untagged, expecting = "is neither a string nor an integer")]
enum RigName {
    Number(i64),
    Text(String),
}

/// Rig of an image, in its entry of `scene_camera.json`.
#[derive(Deserialize)]
struct RigEntry {
    rig: Option<RigName>,
}

impl Dataset {
    /// Opens the split `test`, or the only one there is.
    ///
    /// # Errors
    /// When the folder is absent, holds no scenes, or holds several splits of which none is `test`.
    pub fn open(root: &Path) -> Result<Self, DatasetError> {
        let mut splits = subfolders(root)?;
        splits.retain(|name| {
            let inner = subfolders(&root.join(name)).unwrap_or_default();
            inner.iter().any(|s| scene_id(s).is_some())
        });
        match splits.as_slice() {
            [] => Err(no_scenes(root)),
            [only] => Self::open_split(root, only),
            _ if splits.iter().any(|s| s == "test") => Self::open_split(root, "test"),
            _ => {
                let problem = format!("several splits, name one of {}", splits.join(", "));
                Err(DatasetError::unusable(root, problem))
            }
        }
    }

    /// Opens the split in the subfolder `split`.
    ///
    /// # Errors
    /// When that folder is absent or holds no scenes.
    pub fn open_split(root: &Path, split: &str) -> Result<Self, DatasetError> {
        let split_dir = root.join(split);
        let named = |name: String| Some((scene_id(&name)?, split_dir.join(name)));
        let scenes: Vec<_> = subfolders(&split_dir)?.into_iter().filter_map(named).collect();
        match scenes.is_empty() {
            true => Err(no_scenes(&split_dir)),
            false => Ok(Self::of(root, &split_dir, scenes, Arc::default())),
        }
    }

    fn of(
        root: &Path,
        split_dir: &Path,
        scenes: Vec<(u32, PathBuf)>,
        optics: Arc<SharedOptics>,
    ) -> Self {
        let camera = JsonFile::new(root.join("camera.json"));
        let scene = |(id, dir): (u32, PathBuf)| {
            let file = |name: &str| JsonFile::new(dir.join(name));
            let scene = DatasetScene {
                id,
                camera: scene_camera(&dir, &camera),
                bodies: file("scene_bodies.json"),
                tactile: file("scene_tactile.json"),
                objects: file("scene_gt.json"),
                visibility: file("scene_gt_info.json"),
                true_bodies: file("scene_bodies_gt.json"),
                rigs: OnceLock::new(),
                dir,
            };
            (id, scene)
        };
        Self {
            root: root.to_owned(),
            split_dir: split_dir.to_owned(),
            scenes: Arc::new(scenes.into_iter().map(scene).collect()),
            models: Arc::new(Models::new(root.join("models"))),
            camera: Arc::new(camera),
            optics,
        }
    }

    /// This dataset with its files to be read anew, since they may have been written further.
    pub fn reread(&self) -> Self {
        let scenes = self.scenes.values().map(|scene| (scene.id, scene.dir.clone())).collect();
        Self::of(&self.root, &self.split_dir, scenes, Arc::clone(&self.optics))
    }

    /// The dataset's folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The split's folder.
    pub fn split_dir(&self) -> &Path {
        &self.split_dir
    }

    /// The models that estimators use (`models/`).
    pub fn models(&self) -> &Models {
        &self.models
    }

    /// All scenes in ascending order of their ids.
    pub fn scenes(&self) -> impl Iterator<Item = &DatasetScene> {
        self.scenes.values()
    }

    /// The scene `scene_id`.
    ///
    /// # Errors
    /// When the split holds no folder for it.
    pub fn scene(&self, scene_id: u32) -> Result<&DatasetScene, DatasetError> {
        self.scenes
            .get(&scene_id)
            .ok_or_else(|| DatasetError::unusable(&self.split_dir, format!("no scene {scene_id}")))
    }
}

impl DatasetScene {
    /// The scene's id.
    pub fn id(&self) -> u32 {
        self.id
    }

    /// The scene's folder.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// The folder of color images: `rgb/`, or else `gray/` if there is that.
    pub(crate) fn color_dir(&self) -> PathBuf {
        let [rgb, gray] = ["rgb", "gray"].map(|name| self.dir.join(name));
        if gray.is_dir() && !rgb.is_dir() { gray } else { rgb }
    }

    /// The images that begin a moment: those that `scene_camera.json` lists, and of a rig that took several together the first, ascending.
    ///
    /// # Errors
    /// Those of [`images`](Self::images).
    pub fn moments(&self) -> Result<Vec<u32>, DatasetError> {
        let mut images = self.images()?;
        let others = self.rigs()?.values().flat_map(|together| &together[1..]);
        let others: BTreeSet<u32> = others.copied().collect();
        images.retain(|image| !others.contains(image));
        Ok(images)
    }

    /// The images that a rig took together with `image`, ascending, itself among them; `None` of an image without a rig.
    ///
    /// # Errors
    /// Those of [`images`](Self::images), and if the image's entry of `scene_camera.json` is broken.
    pub(super) fn taken_together(&self, image: u32) -> Result<Option<Vec<u32>>, DatasetError> {
        let RigEntry { rig } = self.camera.entry(image)?;
        let Some(name) = rig else { return Ok(None) };
        Ok(Some(self.rigs()?.get(&name).cloned().unwrap_or_default()))
    }

    /// Images by the name of the rig that took them together.
    fn rigs(&self) -> Result<&BTreeMap<RigName, Vec<u32>>, DatasetError> {
        let by_rig = || {
            let mut by_rig: BTreeMap<RigName, Vec<u32>> = BTreeMap::new();
            for image in self.images()? {
                // One that is broken fails by itself.
                if let Ok(RigEntry { rig: Some(name) }) = self.camera.entry(image) {
                    by_rig.entry(name).or_default().push(image);
                }
            }
            Ok(by_rig)
        };
        self.rigs.get_or_init(by_rig).as_ref().map_err(Clone::clone)
    }

    /// The images that `scene_camera.json` lists, ascending.
    ///
    /// # Errors
    /// When that file is absent or broken, or one of its keys is no image id.
    pub fn images(&self) -> Result<Vec<u32>, DatasetError> {
        let id = |key: &String| {
            let file = self.camera.path();
            let fault = |_| DatasetError::unusable(file, format!("{key:?} is not an image id"));
            key.parse().map_err(fault)
        };
        let mut ids = self.camera.root()?.keys().map(id).collect::<Result<Vec<u32>, _>>()?;
        ids.sort_unstable();
        Ok(ids)
    }
}

fn no_scenes(dir: &Path) -> DatasetError {
    DatasetError::unusable(dir, "no scene folders (expected, for example, test/000001)")
}

fn scene_id(name: &str) -> Option<u32> {
    // `parse` alone would also take "+4".
    name.bytes().all(|b| b.is_ascii_digit()).then(|| name.parse().ok())?
}

/// The names of the folders in `dir`, sorted.
fn subfolders(dir: &Path) -> Result<Vec<String>, DatasetError> {
    let mut names = names(dir)?;
    names.retain(|name| dir.join(name).is_dir());
    Ok(names)
}

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
/// in `rgb/`, or else in `gray/` or `depth/`.
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
    let images = ["rgb", "gray", "depth"].map(|folder| image_ids(&dir.join(folder)));
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
