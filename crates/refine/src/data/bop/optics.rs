//! Images of one camera, read as a pinhole camera of the same matrix and size sees them, with depth of it or of a camera beside it.

use std::path::Path;
use std::sync::OnceLock;

use nalgebra::Isometry3;
use prehend_render::{
    Camera, DepthImage, Distortion, DistortionError, Mask, Remap, RgbImage, image_size,
    register_depth,
};

use super::error::DatasetError;
use super::numbers::{Intrinsics, Lens, Numbers};
use super::pose::{Rotation, stated_pose};
use crate::scene::{Frame, RemapCache};

/// A camera and its lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LensedCamera {
    /// Intrinsics; of unknown size where a dataset says them.
    pub(crate) camera: Camera,
    pub(crate) lens: Option<Distortion>,
}

/// A camera of its own that measured depth, beside that of color.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DepthCamera {
    pub(crate) own: LensedCamera,
    /// Its coordinates → those of the color camera \[m\].
    pub(crate) t_color_depth: Isometry3<f64>,
}

/// Optics of a camera: intrinsics, lens, depth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Optics<'a> {
    pub(crate) color: LensedCamera,
    /// Camera of depth that is not registered.
    pub(crate) depth_camera: Option<DepthCamera>,
    /// Meters of one unit of stored depth.
    pub(crate) depth_unit: f64,
    pub(crate) shared: &'a SharedOptics,
}

/// Optics that images share: maps from lenses, and warnings that are given once.
#[derive(Debug, Default)]
pub(crate) struct SharedOptics {
    remaps: RemapCache,
    told_of_saturated_depth: OnceLock<()>,
    told_of_empty_depth: OnceLock<()>,
}

impl LensedCamera {
    /// Camera and lens as a file states them.
    pub(crate) fn new(Intrinsics(camera): Intrinsics, lens: Option<Lens>) -> Self {
        Self { camera, lens: lens.map(|lens| lens.0) }
    }

    /// An image of that size that is `stored`, as a pinhole camera of the same matrix sees it.
    ///
    /// # Errors
    /// Those of a lens.
    pub(crate) fn undistorted<T>(
        &self,
        stored: T,
        (width, height): (usize, usize),
        remaps: &RemapCache,
        apply: impl FnOnce(&Remap, &T) -> Result<T, DistortionError>,
    ) -> Result<T, DistortionError> {
        let Some(lens) = self.lens else { return Ok(stored) };
        let camera = Camera { width, height, ..self.camera };
        apply(&remaps.get(camera, lens), &stored)
    }
}

impl DepthCamera {
    /// Depth camera as a file states it: intrinsics, lens, and rotation and translation \[mm\] to the color camera; none if it states none of these.
    ///
    /// # Errors
    /// The name of what is missing beside what is there.
    pub(crate) fn stated(
        intrinsics: Option<Intrinsics>,
        lens: Option<Lens>,
        rotation: Option<Rotation>,
        translation: Option<Numbers<3>>,
    ) -> Result<Option<Self>, String> {
        let t_color_depth = stated_pose(rotation, translation, "d2c")?;
        let Some(intrinsics) = intrinsics else {
            let nothing = lens.is_none() && t_color_depth.is_none();
            return if nothing { Ok(None) } else { Err("depth_K".to_owned()) };
        };
        let own = LensedCamera::new(intrinsics, lens);
        Ok(Some(Self { own, t_color_depth: t_color_depth.unwrap_or_default() }))
    }

    /// `depth`, which it measured \[m\], as the pinhole camera `camera` would have.
    ///
    /// # Errors
    /// Those of a lens.
    pub(crate) fn register(
        &self,
        depth: DepthImage,
        camera: &Camera,
        remaps: &RemapCache,
    ) -> Result<DepthImage, DistortionError> {
        let (width, height) = (depth.width(), depth.height());
        let depth = self.own.undistorted(depth, (width, height), remaps, Remap::depth)?;
        let own = Camera { width, height, ..self.own.camera };
        Ok(register_depth(&depth, &own, &self.t_color_depth, camera))
    }
}

impl Optics<'_> {
    /// The camera of an image of `width` by `height` pixels.
    pub(crate) fn camera(&self, width: usize, height: usize) -> Camera {
        Camera { width, height, ..self.color.camera }
    }

    /// Reads a color image.
    pub(crate) fn color(&self, file: &Path) -> Result<RgbImage, DatasetError> {
        let stored = RgbImage::load(file)?;
        let size = (stored.width(), stored.height());
        self.undistorted(file, stored, size, Remap::rgb)
    }

    /// Reads a depth image, registered to a color image of that size; of the depth image's without one. None when it measures nothing; the largest value of
    /// 16 bits is no measurement.
    ///
    /// # Errors
    /// When it is absent or does not decode.
    pub(crate) fn depth(
        &self,
        file: &Path,
        color: Option<(usize, usize)>,
    ) -> Result<Option<DepthImage>, DatasetError> {
        let mut stored = DepthImage::load(file, self.depth_unit)?;
        if let Some(warning) = drop_saturated(&mut stored, self.depth_unit) {
            warn_once(&self.shared.told_of_saturated_depth, file, &warning);
        }
        let size = (stored.width(), stored.height());
        let depth = match &self.depth_camera {
            None => self.undistorted(file, stored, size, Remap::depth)?,
            Some(own) => {
                let (width, height) = color.unwrap_or(size);
                let camera = self.camera(width, height);
                let registered = own.register(stored, &camera, &self.shared.remaps);
                registered.map_err(|e| DatasetError::unusable(file, e))?
            }
        };
        Ok(depth.pixels().iter().any(|&z| z != 0.0).then_some(depth))
    }

    /// Reads a mask.
    ///
    /// # Errors
    /// When it is absent or does not decode, and [`DatasetError::NoMask`] when no pixel is set.
    pub(crate) fn mask(&self, file: &Path) -> Result<Mask, DatasetError> {
        let stored = Mask::load(file)?;
        let size = (stored.width(), stored.height());
        let mask = self.undistorted(file, stored, size, Remap::mask)?;
        match mask.count() {
            0 => Err(DatasetError::no_mask(file, "the mask is empty")),
            _ => Ok(mask),
        }
    }

    /// An image that is `stored` with that `size`, as a pinhole camera sees it.
    pub(crate) fn undistorted<T>(
        &self,
        file: &Path,
        stored: T,
        size: (usize, usize),
        apply: impl FnOnce(&Remap, &T) -> Result<T, DistortionError>,
    ) -> Result<T, DatasetError> {
        let seen = self.color.undistorted(stored, size, &self.shared.remaps, apply);
        seen.map_err(|e| DatasetError::unusable(file, e))
    }

    /// Color and depth, of which there is one at least, with an empty mask. Without color, pictures are black; without depth, and of depth images of zeros beside
    /// color, nothing is measured.
    ///
    /// # Errors
    /// When an image is absent or does not decode, or they differ in size.
    pub(crate) fn observation(
        &self,
        color: Option<&Path>,
        depth: Option<&Path>,
    ) -> Result<Frame, DatasetError> {
        // Before anything is decoded.
        let size = color.map(image_size).transpose()?;
        if let (Some(color), Some(size), Some(depth), None) =
            (color, size, depth, &self.depth_camera)
        {
            check_size(depth, color, size)?;
        }
        let color = color.map(|file| self.color(file)).transpose()?;
        let mut measured = None;
        if let Some(file) = depth {
            measured = self.depth(file, size)?;
            if measured.is_none() && color.is_none() {
                return Err(DatasetError::missing(file, NO_DEPTH));
            }
            if measured.is_none() {
                let warning = format!("{NO_DEPTH}: color alone is used");
                warn_once(&self.shared.told_of_empty_depth, file, &warning);
            }
        }
        let size = size.or(measured.as_ref().map(|depth| (depth.width(), depth.height())));
        let (width, height) = size.unwrap_or_default();
        let depth = measured.unwrap_or_else(|| DepthImage::filled(width, height, 0.0));
        let color = color.unwrap_or_else(|| RgbImage::filled(width, height, [0.0; 3]));
        let mask = Mask::filled(width, height, false);
        let (camera, gravity, hand, views) = (self.camera(width, height), None, None, Vec::new());
        Ok(Frame { camera, color, depth, mask, gravity, hand, views })
    }
}

/// Problem of a depth image that measures nothing.
pub(super) const NO_DEPTH: &str = "every depth is zero";

/// Warns of the depth image in `file` unless others were warned of.
fn warn_once(told: &OnceLock<()>, file: &Path, text: &str) {
    told.get_or_init(|| log::warn!("{}: {text} (other images are not named)", file.display()));
}

/// Refuses an image in `file` of another size than that in `other`, which has this width and height.
pub(crate) fn check_size(
    file: &Path,
    other: &Path,
    (width, height): (usize, usize),
) -> Result<(), DatasetError> {
    let (w, h) = image_size(file)?;
    if (w, h) == (width, height) {
        return Ok(());
    }
    let mut problem = format!("is {w}x{h} pixels but {} is {width}x{height}", other.display());
    if (w, h) == (height, width) {
        problem +=
            ": one of them is turned by 90°; images are read as their EXIF orientation shows them";
    }
    Err(DatasetError::unusable(file, problem))
}

/// Share of an image's pixels from which on it is said that they count as not measured.
const TOLD: f64 = 1e-3;

/// Makes pixels with the largest value of 16 bits, one unit being `unit` meters, not measured: writers put it where they have nothing, and larger values are
/// cut to it. What is to be said of it where there are many.
pub(crate) fn drop_saturated(depth: &mut DepthImage, unit: f64) -> Option<String> {
    let largest = (f64::from(u16::MAX) * unit) as f32;
    // Hardly any image has one: pixels side by side.
    if !depth.pixels().iter().fold(false, |any, z| any | (*z >= largest)) {
        return None;
    }
    let mut count = 0;
    for pixel in depth.pixels_mut().iter_mut().filter(|z| **z >= largest) {
        *pixel = 0.0;
        count += 1;
    }
    let share = f64::from(count) / depth.pixels().len().max(1) as f64;
    (share >= TOLD).then(|| {
        let percent = 1e2 * share;
        format!(
            "{percent:.1} % of the pixels are {}, which counts as not measured, as 0 does",
            u16::MAX
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_value_is_no_measurement() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("depth.png");
        for unit in [1e-3, 1e-4, 2.5e-4] {
            let stored = DepthImage::new(2, 2, vec![0.0, 0.5, 1e3, 1.0]).unwrap();
            stored.save(&path, unit).unwrap();
            let mut depth = DepthImage::load(&path, unit).unwrap();
            let said = drop_saturated(&mut depth, unit).unwrap();
            assert!(said.starts_with("25.0 % of the pixels are 65535"), "{said}");
            assert_eq!(depth.pixels()[2], 0.0);
            assert_eq!(depth.pixels().iter().filter(|z| **z > 0.0).count(), 2);
            assert_eq!(drop_saturated(&mut depth, unit), None);
        }
    }
}
