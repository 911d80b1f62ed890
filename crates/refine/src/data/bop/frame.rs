//! One image of a scene.

use std::path::{Path, PathBuf};

use nalgebra::Isometry3;
use prehend_render::{Camera, DepthImage, Mask, Remap, image_size};
use serde::Deserialize;

use super::bodies::SceneBodies;
use super::dataset::{Dataset, DatasetScene};
use super::error::{ABSENT, DatasetError, Origin};
use super::files::names;
use super::numbers::{Intrinsics, Lens, Numbers, Positive};
use super::optics::{DepthCamera, LensedCamera, NO_DEPTH, Optics, check_size};
use super::pose::{Rotation, stated_pose};
use super::touch::Tactile;
use crate::scene::Frame;

/// One image: its camera, and access to everything else an estimator may know about it. Each part is
/// read when asked for and fails on its own.
///
/// Where the dataset says that images were taken through a lens (`cam_dist` of `scene_camera.json`, or of `camera.json` for all of them),
/// they are handed out as a pinhole camera of the same matrix and size sees them. Depth of a camera of its own is registered to the color camera.
#[derive(Clone, Copy, Debug)]
pub struct DatasetImage<'a> {
    dataset: &'a Dataset,
    scene: &'a DatasetScene,
    im_id: u32,
    optics: Optics<'a>,
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
    #[serde(rename = "depth_K")]
    depth_intrinsics: Option<Intrinsics>,
    #[serde(rename = "depth_dist")]
    depth_lens: Option<Lens>,
    #[serde(rename = "cam_R_d2c")]
    depth_rotation: Option<Rotation>,
    #[serde(rename = "cam_t_d2c")]
    depth_translation: Option<Numbers<3>>,
}

/// World → camera pose of an image, which the estimator reads only of images that a rig took together.
#[derive(Deserialize)]
struct PlaceEntry {
    #[serde(rename = "cam_R_w2c")]
    rotation: Option<Rotation>,
    #[serde(rename = "cam_t_w2c")]
    translation: Option<Numbers<3>>,
}

/// Entry of `scene_gt.json`, of which estimators may read the object alone.
#[derive(Deserialize)]
struct ListedObject {
    obj_id: u32,
}

impl Dataset {
    /// The image `im_id` of the scene `scene_id`.
    ///
    /// # Errors
    /// Those of [`Dataset::scene`], and when `scene_camera.json` is absent or broken, or does not describe the image; when
    /// `camera.json` is broken.
    pub fn frame(&self, scene_id: u32, im_id: u32) -> Result<DatasetImage<'_>, DatasetError> {
        let scene = self.scene(scene_id)?;
        let entry: CameraEntry = scene.camera.entry(im_id)?;
        let CameraEntry { intrinsics, depth_scale, mut lens, .. } = entry;
        if lens.is_none() && self.camera.exists() {
            lens = self.camera.field("cam_dist")?;
        }
        scene.camera.check_rotations(entry.depth_rotation.iter());
        let depth_camera = DepthCamera::stated(
            entry.depth_intrinsics,
            entry.depth_lens,
            entry.depth_rotation,
            entry.depth_translation,
        );
        let depth_scale = depth_scale.map_or(1.0, |scale| scale.0);
        let optics = Optics {
            color: LensedCamera::new(intrinsics, lens),
            depth_camera: depth_camera
                .map_err(|name| scene.camera.fault(&format!("{im_id}.{name}"), "is missing"))?,
            depth_unit: depth_scale * 1e-3,
            shared: &self.optics,
        };
        Ok(DatasetImage { dataset: self, scene, im_id, optics, depth_scale })
    }
}

impl DatasetImage<'_> {
    /// The camera that the estimator is told, for an image of `width` by `height` pixels: BOP keeps no sizes.
    pub fn camera(&self, width: usize, height: usize) -> Camera {
        self.optics.camera(width, height)
    }

    /// The color image (`rgb/*.png`, else `*.jpg` or `*.jpeg`), or a gray one in `gray/` where there is no `rgb/`. Its number may be without zeros before
    /// it.
    ///
    /// # Errors
    /// [`DatasetError::Unusable`] naming the PNG file and what there is instead, [`DatasetError::Missing`] when the folder holds nothing.
    pub fn rgb_path(&self) -> Result<PathBuf, DatasetError> {
        first_image(&self.scene.color_dir(), &[self.im_id]).map_err(|file| instead_of(&file))
    }

    /// The depth image.
    ///
    /// # Errors
    /// Those of [`DatasetImage::rgb_path`].
    pub(super) fn depth_path(&self) -> Result<PathBuf, DatasetError> {
        first_image(&self.depth_dir(), &[self.im_id]).map_err(|file| instead_of(&file))
    }

    /// The file of an object's mask; see [`DatasetImage::mask`].
    fn mask_path(&self, instance: usize) -> Result<PathBuf, DatasetError> {
        let mut masks = self.mask_files();
        if let (Some(only), None) = (masks.next(), masks.next()) {
            return Ok(only);
        }
        let numbers = [self.im_id, instance as u32];
        let found = first_image(&self.scene.dir().join("mask_visib"), &numbers);
        found.map_err(|file| DatasetError::no_mask(&file, ABSENT))
    }

    /// The files of the image's masks, in any order.
    fn mask_files(&self) -> impl Iterator<Item = PathBuf> + use<> {
        self.mask_listing()
            .filter(|path| path.file_name().and_then(|name| name.to_str()).is_some_and(is_image))
    }

    /// All files in the folder of masks that begin as the image's do.
    pub(super) fn mask_listing(&self) -> impl Iterator<Item = PathBuf> + use<> {
        let (folder, im_id) = (self.scene.dir().join("mask_visib"), self.im_id);
        let image = |name: &str| -> Option<u32> { name.split_once('_')?.0.parse().ok() };
        let names = names(&folder).unwrap_or_default().into_iter();
        names.filter(move |name| image(name) == Some(im_id)).map(move |name| folder.join(name))
    }

    /// Reads the depth image, registered to the color image. The largest value of 16 bits is no measurement, of which is warned once a dataset.
    ///
    /// # Errors
    /// When it does not decode, and [`DatasetError::Missing`] when it is absent or measures nothing.
    pub fn depth(&self) -> Result<DepthImage, DatasetError> {
        let beside = self.optics.depth_camera.is_some() && self.has_color();
        let color = if beside { Some(image_size(&self.rgb_path()?)?) } else { None };
        let file = first_image(&self.depth_dir(), &[self.im_id]);
        let file = file.map_err(|file| DatasetError::absent(&file))?;
        self.optics.depth(&file, color)?.ok_or_else(|| DatasetError::missing(&file, NO_DEPTH))
    }

    /// The number of the mask of the object `obj_id`. Masks are numbered as `scene_gt.json` lists the objects, of which nothing else is read. Of several
    /// such objects it is that of `instance`, the index of the object's row among that image's rows of the results file
    /// ([`super::ReadResults::instances`]), if it is one of them, and else number `instance` among them. Without such a list it is `instance`.
    pub fn mask_number(&self, obj_id: u32, instance: usize) -> usize {
        let Ok(listed) = self.scene.objects.entry::<Vec<ListedObject>>(self.im_id) else {
            return instance;
        };
        let same = |(_, listed): &(usize, ListedObject)| listed.obj_id == obj_id;
        let numbers: Vec<usize> =
            listed.into_iter().enumerate().filter(same).map(|(k, _)| k).collect();
        match numbers.contains(&instance) {
            true => instance,
            false => numbers.get(instance).or(numbers.first()).copied().unwrap_or(instance),
        }
    }

    /// The numbers of the image's masks, in order.
    pub(crate) fn mask_numbers(&self) -> Vec<usize> {
        let mut numbers: Vec<usize> =
            self.mask_files().filter_map(|file| Some(number_of(&file)? as usize)).collect();
        numbers.sort_unstable();
        numbers
    }

    /// Reads the mask of an object's visible part: the only one of an image whatever its number, among several the one of this number
    /// ([`mask_number`](Self::mask_number)).
    ///
    /// # Errors
    /// When it is absent, does not decode, or no pixel is set.
    pub fn mask(&self, instance: usize) -> Result<Mask, DatasetError> {
        self.optics.mask(&self.mask_path(instance)?)
    }

    /// The image as a [`Frame`] of camera, color, depth and mask; gravity and the hand are left out.
    ///
    /// # Errors
    /// If an image is absent, does not decode, measures nothing or differs in size, and those of [`DatasetImage::mask`].
    pub fn observation(&self, instance: usize) -> Result<Frame, DatasetError> {
        let mut observation = self.unsegmented()?;
        self.segment(&mut observation, instance)?;
        Ok(observation)
    }

    /// Gives `observation`, which is of this image, the mask of an object's visible part.
    ///
    /// # Errors
    /// Those of [`DatasetImage::mask`], and if it has another size.
    pub(crate) fn segment(
        &self,
        observation: &mut Frame,
        instance: usize,
    ) -> Result<(), DatasetError> {
        self.segment_by(observation, &self.mask_path(instance)?)
    }

    /// Gives `observation`, which is of this image, the mask in `file`.
    fn segment_by(&self, observation: &mut Frame, file: &Path) -> Result<(), DatasetError> {
        let image = if self.has_color() { self.rgb_path()? } else { self.depth_path()? };
        let Camera { width, height, .. } = observation.camera;
        check_size(file, &image, (width, height))?;
        observation.mask = self.optics.mask(file)?;
        Ok(())
    }

    /// A mask of the image as it was taken, as a pinhole camera sees it.
    ///
    /// # Errors
    /// If it has another size than the image.
    pub(crate) fn undistorted_mask(&self, stored: Mask) -> Result<Mask, DatasetError> {
        let size = (stored.width(), stored.height());
        self.optics.undistorted(self.scene.dir(), stored, size, Remap::mask)
    }

    /// Whether the scene has a folder of color images.
    pub(super) fn has_color(&self) -> bool {
        self.scene.color_dir().is_dir()
    }

    /// Width and height of the color image, or without color images of the camera that `camera.json` describes \[px\].
    ///
    /// # Errors
    /// If neither is known.
    pub(crate) fn image_size(&self) -> Result<(usize, usize), DatasetError> {
        if self.has_color() {
            return Ok(image_size(&self.rgb_path()?)?);
        }
        let of_camera = |name: &str| {
            let file = &self.dataset.camera;
            let size = file.field::<u32>(name)?;
            let missing = || file.fault(name, "is missing, and there are no images");
            size.map(|size| size as usize).ok_or_else(missing)
        };
        Ok((of_camera("width")?, of_camera("height")?))
    }

    /// Whether the scene has a folder of depth images.
    pub(crate) fn has_depth(&self) -> bool {
        self.depth_dir().is_dir()
    }

    fn depth_dir(&self) -> PathBuf {
        self.scene.dir().join("depth")
    }

    /// The image as a [`Frame`] with an empty mask. Without color, pictures are black. Without depth nothing is measured, as in depth images of zeros
    /// beside color, of which is warned once a dataset.
    ///
    /// # Errors
    /// If an image is absent or does not decode, or they differ in size.
    pub(crate) fn unsegmented(&self) -> Result<Frame, DatasetError> {
        let has_color = self.has_color() || !self.has_depth();
        if self.optics.depth_camera.is_some() && !has_color {
            let problem = "is of a camera beside the color camera, and the scene has no rgb";
            return Err(self.scene.camera.fault(&format!("{}.depth_K", self.im_id), problem));
        }
        let color = if has_color { Some(self.rgb_path()?) } else { None };
        let depth = self.has_depth().then(|| self.depth_path()).transpose()?;
        self.optics.observation(color.as_deref(), depth.as_deref())
    }

    /// Frames of the rig's other cameras at the same moment that have a mask of the object, each with the transform from its camera's coordinates to this
    /// image's \[m\]. None for an image without a rig.
    ///
    /// # Errors
    /// Those of [`DatasetImage::observation`] of each, and if one lacks its place.
    pub(crate) fn taken_together(
        &self,
        instance: usize,
    ) -> Result<Vec<(Frame, Isometry3<f64>)>, DatasetError> {
        let Some(together) = self.scene.taken_together(self.im_id)? else { return Ok(Vec::new()) };
        let t_cam_world = self.place()?;
        let number = self.mask_path(instance).ok().and_then(|file| number_of(&file));
        let number = number.unwrap_or(instance as u32);
        let mut seen = Vec::new();
        for image in together.into_iter().filter(|image| *image != self.im_id) {
            let other = self.dataset.frame(self.scene.id(), image)?;
            let t_cam_other = t_cam_world * other.place()?.inverse();
            if t_cam_other == Isometry3::identity() {
                let problem = format!("is the place of image {} of the same rig, too", self.im_id);
                return Err(self.scene.camera.fault(&format!("{image}.cam_t_w2c"), &problem));
            }
            let Ok(file) = first_image(&self.scene.dir().join("mask_visib"), &[image, number])
            else {
                continue;
            };
            let mut view = other.unsegmented()?;
            match other.segment_by(&mut view, &file) {
                Err(DatasetError::NoMask { .. }) => continue,
                segmented => segmented?,
            }
            seen.push((view, t_cam_other));
        }
        Ok(seen)
    }

    /// World → camera \[m\], where the dataset says so: for whatever shows images in one frame. The estimator asks of images alone that a rig took together.
    ///
    /// # Errors
    /// If what is said is broken, or one of rotation and translation is absent.
    pub fn t_cam_world(&self) -> Result<Option<Isometry3<f64>>, DatasetError> {
        let PlaceEntry { rotation, translation } = self.scene.camera.entry(self.im_id)?;
        self.scene.camera.check_rotations(rotation.iter());
        stated_pose(rotation, translation, "w2c").map_err(|name| self.lacks(&name))
    }

    /// World → camera \[m\].
    fn place(&self) -> Result<Isometry3<f64>, DatasetError> {
        self.t_cam_world()?.ok_or_else(|| self.lacks("cam_R_w2c"))
    }

    /// The error that the image's entry of `scene_camera.json` is without a field.
    fn lacks(&self, field: &str) -> DatasetError {
        self.scene.camera.fault(&format!("{}.{field}", self.im_id), "is missing")
    }

    /// Gravity, the known robots and other bodies, from `scene_bodies.json`.
    ///
    /// # Errors
    /// When the file is absent or broken, or lacks the image or one of its fields.
    pub fn bodies(&self) -> Result<SceneBodies, DatasetError> {
        SceneBodies::read(&self.scene.bodies, self.im_id, self.dataset.root())
    }

    /// Readings of tactile sensors, from `scene_tactile.json`.
    ///
    /// # Errors
    /// When the file is absent or broken, or lacks the image or one of its fields.
    pub fn tactile(&self) -> Result<Vec<Tactile>, DatasetError> {
        Tactile::read(&self.scene.tactile, self.im_id, self.dataset.root())
    }

    /// This image's entry of `scene_bodies.json`.
    pub(crate) fn bodies_entry(&self) -> Origin {
        Origin::new(self.scene.bodies.path(), self.im_id.to_string())
    }
}

/// Extensions of images' names, in the order in which they are looked for.
const IMAGE_EXTENSIONS: [&str; 3] = ["png", "jpg", "jpeg"];

/// Number of names that tell how the files of a folder are called.
const NAMED: usize = 3;

/// The image in `folder` with these numbers in its name, such as `000003_000002.png`, which may be without zeros before them and in capital letters behind them.
///
/// # Errors
/// The PNG file if there is none.
fn first_image(folder: &Path, numbers: &[u32]) -> Result<PathBuf, PathBuf> {
    let stem = numbers.iter().map(|number| format!("{number:06}")).collect::<Vec<_>>().join("_");
    let usual = IMAGE_EXTENSIONS.map(|extension| folder.join(format!("{stem}.{extension}")));
    if let Some(file) = usual.iter().find(|file| file.is_file()) {
        return Ok(file.clone());
    }
    let names = names(folder).unwrap_or_default();
    let is_same = |name: &str| is_image(name) && numbers_in(name).as_deref() == Some(numbers);
    let found = names.iter().find(|name| is_same(name)).map(|name| folder.join(name));
    found.ok_or_else(|| usual[0].clone())
}

/// The error that `file` is not among the files of its folder, which are not called as they have to be.
fn instead_of(file: &Path) -> DatasetError {
    let mut names = file.parent().and_then(|folder| names(folder).ok()).unwrap_or_default();
    if names.is_empty() {
        return DatasetError::absent(file);
    }
    let more = if names.len() > NAMED { ", …" } else { "" };
    names.truncate(NAMED);
    let problem = format!("no such file; the folder has {}{more}", names.join(", "));
    DatasetError::unusable(file, problem)
}

/// True of the name of an image file.
fn is_image(name: &str) -> bool {
    let extension = name.split_once('.').map_or("", |(_, extension)| extension);
    IMAGE_EXTENSIONS.iter().any(|known| known.eq_ignore_ascii_case(extension))
}

/// The numbers that make up the name of an image without its extension.
fn numbers_in(name: &str) -> Option<Vec<u32>> {
    name.split('.').next()?.split('_').map(|number| number.parse().ok()).collect()
}

/// The number of the object that the mask in `file` is of.
fn number_of(file: &Path) -> Option<u32> {
    numbers_in(file.file_name()?.to_str()?)?.get(1).copied()
}
