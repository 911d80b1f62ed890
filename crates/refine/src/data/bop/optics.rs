//! Images of one camera, read as a pinhole camera of the same matrix and size sees them.

use std::path::Path;

use prehend_render::{
    Camera, DepthImage, Distortion, DistortionError, Mask, Remap, RgbImage, image_size,
};

use super::depth_camera::DepthCamera;
use super::depth_values::drop_saturated;
use super::error::DatasetError;
use crate::scene::{Frame, RemapCache};

/// Optics of a camera: intrinsics, lens, depth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Optics<'a> {
    /// Intrinsics; of unknown size.
    pub(crate) camera: Camera,
    pub(crate) lens: Option<Distortion>,
    /// Camera of depth that is not registered.
    pub(crate) depth_camera: Option<DepthCamera>,
    /// Meters of one unit of stored depth.
    pub(crate) depth_unit: f64,
    pub(crate) remaps: &'a RemapCache,
    pub(crate) depth_remaps: &'a RemapCache,
}

/// Kind of a warning about a depth image: values that are none, or nothing measured.
#[derive(Clone, Copy)]
pub(crate) enum DepthWarning {
    Saturated,
    Empty,
}

/// Hears of a warning about the depth image in a file.
pub(crate) type Warn<'a> = &'a dyn Fn(&Path, DepthWarning, &str);

impl Optics<'_> {
    /// The camera of an image of `width` by `height` pixels.
    pub(crate) fn camera(&self, width: usize, height: usize) -> Camera {
        Camera { width, height, ..self.camera }
    }

    /// Reads a color image.
    pub(crate) fn color(&self, file: &Path) -> Result<RgbImage, DatasetError> {
        let stored = RgbImage::load(file)?;
        let size = (stored.width(), stored.height());
        self.undistorted(file, stored, size, Remap::rgb)
    }

    /// Reads a depth image, registered to a color image of that size; of the depth image's without one. The largest value of 16 bits is no measurement.
    ///
    /// # Errors
    /// When it is absent or does not decode, and [`DatasetError::NoDepth`] when it measures nothing.
    pub(crate) fn depth(
        &self,
        file: &Path,
        color: Option<(usize, usize)>,
        warn: Warn<'_>,
    ) -> Result<DepthImage, DatasetError> {
        let mut stored = DepthImage::load(file, self.depth_unit)?;
        if let Some(warning) = drop_saturated(&mut stored, self.depth_unit) {
            warn(file, DepthWarning::Saturated, &warning);
        }
        let size = (stored.width(), stored.height());
        let depth = match &self.depth_camera {
            None => self.undistorted(file, stored, size, Remap::depth)?,
            Some(own) => {
                let (width, height) = color.unwrap_or(size);
                let registered =
                    own.register(stored, &self.camera(width, height), self.depth_remaps);
                registered.map_err(|e| DatasetError::unusable(file, e))?
            }
        };
        match depth.pixels().iter().all(|&z| z == 0.0) {
            true => Err(DatasetError::NoDepth { file: file.to_owned() }),
            false => Ok(depth),
        }
    }

    /// Reads a mask.
    ///
    /// # Errors
    /// When it is absent or does not decode, and [`DatasetError::EmptyMask`] when no pixel is set.
    pub(crate) fn mask(&self, file: &Path) -> Result<Mask, DatasetError> {
        let stored = Mask::load(file)?;
        let size = (stored.width(), stored.height());
        let mask = self.undistorted(file, stored, size, Remap::mask)?;
        match mask.count() {
            0 => Err(DatasetError::EmptyMask { file: file.to_owned() }),
            _ => Ok(mask),
        }
    }

    /// An image that is `stored` with that `size`, as a pinhole camera sees it.
    pub(crate) fn undistorted<T>(
        &self,
        file: &Path,
        stored: T,
        (width, height): (usize, usize),
        apply: impl FnOnce(&Remap, &T) -> Result<T, DistortionError>,
    ) -> Result<T, DatasetError> {
        let Some(lens) = self.lens else { return Ok(stored) };
        let remap = self.remaps.get(self.camera(width, height), lens);
        apply(&remap, &stored).map_err(|e| DatasetError::unusable(file, e))
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
        warn: Warn<'_>,
    ) -> Result<Frame, DatasetError> {
        // Before anything is decoded.
        let size = color.map(image_size).transpose()?;
        if let (Some(color), Some(depth), None) = (color, depth, &self.depth_camera) {
            check_size(depth, color)?;
        }
        let color = color.map(|file| self.color(file)).transpose()?;
        let depth = depth.map(|file| self.depth(file, size, warn)).transpose();
        let depth = match depth {
            Err(DatasetError::NoDepth { file }) if color.is_some() => {
                warn(&file, DepthWarning::Empty, "every depth is zero: color alone is used");
                None
            }
            read => read?,
        };
        let size = size.or(depth.as_ref().map(|depth| (depth.width(), depth.height())));
        let (width, height) = size.unwrap_or_default();
        let depth = depth.unwrap_or_else(|| DepthImage::filled(width, height, 0.0));
        let color = color.unwrap_or_else(|| RgbImage::filled(width, height, [0.0; 3]));
        let mask = Mask::filled(width, height, false);
        Ok(Frame::new(self.camera(width, height)).color(color).depth(depth).mask(mask))
    }
}

/// Refuses an image in `file` of another size than that in `other`.
pub(crate) fn check_size(file: &Path, other: &Path) -> Result<(), DatasetError> {
    let ((w, h), (width, height)) = (image_size(file)?, image_size(other)?);
    if (w, h) == (width, height) {
        return Ok(());
    }
    let problem = format!("is {w}x{h} pixels but {} is {width}x{height}", other.display());
    Err(DatasetError::unusable(file, problem))
}
