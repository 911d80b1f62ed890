//! One image of a scene.

use std::fs;
use std::path::{Path, PathBuf};

use prehend_render::{
    Camera, CameraError, DepthImage, Distortion, DistortionError, Mask, Remap, RgbImage,
};
use serde::Deserialize;

use super::dataset::{Dataset, Scene};
use super::error::DatasetError;
use super::json::{JsonFile, Numbers, Positive};
use super::lens::Lens;
use super::scene::{SceneBodies, Tactile};
use crate::scene::Observation;

/// One image: its camera, and access to everything else an estimator may know about it. Each part is
/// read when asked for and fails on its own.
///
/// Where the dataset says that images were taken through a lens (`cam_dist` of `scene_camera.json`, or of `camera.json` for all of them),
/// they are handed out as a pinhole camera of the same matrix and size sees them.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    scene: &'a Scene,
    im_id: u32,
    intrinsics: Intrinsics,
    lens: Option<Distortion>,
    /// Millimeters per stored depth value.
    pub depth_scale: f64,
}

#[derive(Deserialize)]
struct CameraEntry {
    #[serde(rename = "cam_K")]
    intrinsics: Intrinsics,
    depth_scale: Option<Positive>,
    #[serde(rename = "cam_dist")]
    lens: Option<Lens>,
}

/// What `cam_K` says of a camera of unknown size.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "Numbers<9>")]
struct Intrinsics(Camera);

impl TryFrom<Numbers<9>> for Intrinsics {
    type Error = CameraError;

    fn try_from(k: Numbers<9>) -> Result<Self, CameraError> {
        Camera::from_k(k.0, 1, 1).map(Self)
    }
}

impl Dataset {
    /// The image `im_id` of the scene `scene_id`.
    ///
    /// # Errors
    /// Those of [`Dataset::scene`], and when `scene_camera.json` is absent or broken, or does not describe the image; when
    /// `camera.json` is broken.
    pub fn frame(&self, scene_id: u32, im_id: u32) -> Result<Frame<'_>, DatasetError> {
        let scene = self.scene(scene_id)?;
        let CameraEntry { intrinsics, depth_scale, mut lens } = scene.camera.entry(im_id)?;
        if lens.is_none() && self.camera.exists() {
            lens = self.camera.field("cam_dist")?;
        }
        Ok(Frame {
            scene,
            im_id,
            intrinsics,
            lens: lens.map(|lens| lens.0),
            depth_scale: depth_scale.map_or(1.0, |scale| scale.0),
        })
    }
}

impl Frame<'_> {
    /// The camera that the estimator is told, for an image of `width` by `height` pixels: BOP keeps no sizes.
    pub fn camera(&self, width: usize, height: usize) -> Camera {
        Camera { width, height, ..self.intrinsics.0 }
    }

    /// The color image (`rgb/*.png`, else `*.jpg` or `*.jpeg`).
    ///
    /// # Errors
    /// [`DatasetError::Missing`] naming the PNG file when there is none.
    pub fn rgb_path(&self) -> Result<PathBuf, DatasetError> {
        let stem = self.scene.dir().join("rgb").join(format!("{:06}", self.im_id));
        let mut candidates = ["png", "jpg", "jpeg"].into_iter().map(|e| stem.with_extension(e));
        candidates
            .find(|p| p.is_file())
            .ok_or_else(|| DatasetError::Missing { file: stem.with_extension("png") })
    }

    /// The depth image, whether or not it exists.
    pub(super) fn depth_path(&self) -> PathBuf {
        self.scene.dir().join("depth").join(format!("{:06}.png", self.im_id))
    }

    /// The file of an object's mask; see [`Frame::mask`].
    fn mask_path(&self, instance: usize) -> Result<PathBuf, DatasetError> {
        let dir = self.scene.dir().join("mask_visib");
        let prefix = format!("{:06}_", self.im_id);
        let expected = dir.join(format!("{prefix}{instance:06}.png"));
        let Ok(listing) = fs::read_dir(&dir) else {
            return Err(DatasetError::Missing { file: expected });
        };
        let mut masks = listing.flatten().map(|f| f.path()).filter(|p| {
            p.file_name()
                .and_then(|n| n.to_str())
                .is_some_and(|n| n.starts_with(&prefix) && n.ends_with(".png"))
        });
        match (masks.next(), masks.next()) {
            (Some(only), None) => Ok(only),
            _ if expected.is_file() => Ok(expected),
            _ => Err(DatasetError::Missing { file: expected }),
        }
    }

    /// Reads the color image.
    ///
    /// # Errors
    /// When it is absent or does not decode.
    pub fn rgb(&self) -> Result<RgbImage, DatasetError> {
        let file = self.rgb_path()?;
        let stored = RgbImage::load(&file)?;
        let size = (stored.width(), stored.height());
        self.undistorted(&file, stored, size, Remap::rgb)
    }

    /// Reads the depth image.
    ///
    /// # Errors
    /// When it is absent or does not decode, and [`DatasetError::NoDepth`] when it measures nothing.
    pub fn depth(&self) -> Result<DepthImage, DatasetError> {
        let file = self.depth_path();
        let stored = DepthImage::load(&file, self.depth_scale * 1e-3)?;
        let size = (stored.width(), stored.height());
        let depth = self.undistorted(&file, stored, size, Remap::depth)?;
        if depth.pixels().iter().all(|&z| z == 0.0) {
            Err(DatasetError::NoDepth { file })
        } else {
            Ok(depth)
        }
    }

    /// Reads the mask of an object's visible part.
    ///
    /// Mask files are numbered by the order of the objects in the ground truth, which estimators must not
    /// read. So the only mask of an image is taken for any `instance`; among several, the one whose number
    /// is `instance`, the index of the object's row among that image's rows of the results file
    /// ([`super::ReadResults::instances`]). Results for images with several masks must list the objects in
    /// the order of the masks.
    ///
    /// # Errors
    /// When it is absent, does not decode, or no pixel is set.
    pub fn mask(&self, instance: usize) -> Result<Mask, DatasetError> {
        let file = self.mask_path(instance)?;
        let stored = Mask::load(&file)?;
        let size = (stored.width(), stored.height());
        let mask = self.undistorted(&file, stored, size, Remap::mask)?;
        if mask.count() == 0 {
            return Err(DatasetError::EmptyMask { file });
        }
        Ok(mask)
    }

    /// An image that is `stored` with that `size`, as a pinhole camera sees it.
    fn undistorted<T>(
        &self,
        file: &Path,
        stored: T,
        (width, height): (usize, usize),
        apply: impl FnOnce(&Remap, &T) -> Result<T, DistortionError>,
    ) -> Result<T, DatasetError> {
        let Some(lens) = self.lens else { return Ok(stored) };
        let remap = self.scene.remaps.get(self.camera(width, height), lens);
        apply(&remap, &stored).map_err(|e| DatasetError::unusable(file, e))
    }

    /// The image as an [`Observation`] of camera, color, depth and mask; gravity and the hand are left out.
    ///
    /// # Errors
    /// The first of those of [`Frame::rgb`], [`Frame::depth`] and [`Frame::mask`], and
    /// images that differ in size.
    pub fn observation(&self, instance: usize) -> Result<Observation, DatasetError> {
        let mut observation = self.unsegmented()?;
        self.segment(&mut observation, instance)?;
        Ok(observation)
    }

    /// Gives `observation`, which is of this image, the mask of an object's visible part.
    ///
    /// # Errors
    /// Those of [`Frame::mask`], and if it has another size.
    pub(crate) fn segment(
        &self,
        observation: &mut Observation,
        instance: usize,
    ) -> Result<(), DatasetError> {
        let mask = self.mask(instance)?;
        self.check_size(&self.mask_path(instance)?, (mask.width(), mask.height()), observation)?;
        observation.mask = mask;
        Ok(())
    }

    /// The same with an empty mask.
    ///
    /// # Errors
    /// Those of [`Frame::rgb`] and [`Frame::depth`], and if the images differ in size.
    pub(crate) fn unsegmented(&self) -> Result<Observation, DatasetError> {
        let (color, depth) = (self.rgb()?, self.depth()?);
        let (width, height) = (color.width(), color.height());
        let (camera, mask) = (self.camera(width, height), Mask::filled(width, height, false));
        let depth_size = (depth.width(), depth.height());
        let observation = Observation { camera, color, depth, mask, gravity: None, hand: None };
        self.check_size(&self.depth_path(), depth_size, &observation)?;
        Ok(observation)
    }

    /// Refuses an image in `file` of another size than the color image.
    fn check_size(
        &self,
        file: &Path,
        (w, h): (usize, usize),
        Observation { color, .. }: &Observation,
    ) -> Result<(), DatasetError> {
        let (width, height) = (color.width(), color.height());
        if (w, h) == (width, height) {
            return Ok(());
        }
        let other = self.rgb_path()?;
        let problem = format!("is {w}x{h} pixels but {} is {width}x{height}", other.display());
        Err(DatasetError::unusable(file, problem))
    }

    /// Gravity and the known robots, from `scene_bodies.json`.
    ///
    /// # Errors
    /// When the file is absent or broken, or lacks the image or one of its fields.
    pub fn bodies(&self) -> Result<SceneBodies, DatasetError> {
        SceneBodies::read(&self.scene.bodies, self.im_id, self.scene.root())
    }

    /// Taxel forces, from `scene_tactile.json`.
    ///
    /// # Errors
    /// When the file is absent or broken, or lacks the image or one of its fields.
    pub fn tactile(&self) -> Result<Tactile, DatasetError> {
        Tactile::read(&self.scene.tactile, self.im_id, self.scene.root())
    }

    /// An error about `field` of this image's entry of `scene_bodies.json`.
    pub(crate) fn bodies_fault(&self, field: &str, problem: impl ToString) -> DatasetError {
        self.fault(&self.scene.bodies, field, problem)
    }

    /// An error about `field` of this image's entry of `scene_tactile.json`.
    pub(crate) fn tactile_fault(&self, field: &str, problem: impl ToString) -> DatasetError {
        self.fault(&self.scene.tactile, field, problem)
    }

    fn fault(&self, file: &JsonFile, field: &str, problem: impl ToString) -> DatasetError {
        DatasetError::field(file.path(), &format!("{}.{field}", self.im_id), problem)
    }
}
