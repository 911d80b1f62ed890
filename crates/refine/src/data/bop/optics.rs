//! Images of one camera, read as a pinhole camera of the same matrix and size sees them, with depth of it or of a camera beside it.

use std::path::Path;

use nalgebra::Isometry3;
use prehend_render::{
    Camera, DepthImage, Distortion, DistortionError, Mask, Remap, RgbImage, image_size,
    register_depth,
};

use super::error::DatasetError;
use super::frame::Intrinsics;
use super::numbers::{Lens, Numbers, Rotation, pose};
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

/// Share of an image's pixels from which on it is said that they count as not measured.
const TOLD: f64 = 1e-3;

/// Makes pixels with the largest value of 16 bits, one unit being `unit` meters, not measured: writers put it where they have nothing, and larger values are
/// cut to it. What is to be said of it where there are many.
pub(crate) fn drop_saturated(depth: &mut DepthImage, unit: f64) -> Option<String> {
    let largest = (f64::from(u16::MAX) * unit) as f32;
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

/// A camera of its own, that measured depth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DepthCamera {
    /// Of unknown size.
    camera: Camera,
    lens: Option<Distortion>,
    /// Its coordinates → those of the color camera \[m\].
    t_color_depth: Isometry3<f64>,
}

impl DepthCamera {
    /// Depth camera of intrinsics, lens, and rotation and translation \[mm\] to the color camera; none if nothing is said.
    ///
    /// # Errors
    /// The name of what is missing beside what is there.
    pub(crate) fn new(
        camera: Option<Intrinsics>,
        lens: Option<Lens>,
        place: (Option<Rotation>, Option<Numbers<3>>),
    ) -> Result<Option<Self>, &'static str> {
        let t_color_depth = match place {
            (None, None) => None,
            (Some(rotation), Some(mm)) => Some(pose(&rotation, &mm)),
            (None, Some(_)) => return Err("cam_R_d2c"),
            (Some(_), None) => return Err("cam_t_d2c"),
        };
        let Some(Intrinsics(camera)) = camera else {
            let nothing = lens.is_none() && t_color_depth.is_none();
            return if nothing { Ok(None) } else { Err("depth_K") };
        };
        let t_color_depth = t_color_depth.unwrap_or_else(Isometry3::identity);
        Ok(Some(Self::beside(camera, lens.map(|lens| lens.0), t_color_depth)))
    }

    /// Behind `lens`, in that place beside the color camera \[m\].
    pub(crate) fn beside(
        camera: Camera,
        lens: Option<Distortion>,
        t_color_depth: Isometry3<f64>,
    ) -> Self {
        Self { camera, lens, t_color_depth }
    }

    /// `depth`, which it measured \[m\], as the pinhole camera `camera` would have.
    ///
    /// # Errors
    /// Those of a lens.
    pub(crate) fn register(
        &self,
        mut depth: DepthImage,
        camera: &Camera,
        remaps: &RemapCache,
    ) -> Result<DepthImage, DistortionError> {
        let (width, height) = (depth.width(), depth.height());
        let own = Camera { width, height, ..self.camera };
        if let Some(lens) = self.lens {
            depth = remaps.get(own, lens).depth(&depth)?;
        }
        Ok(register_depth(&depth, &own, &self.t_color_depth, camera))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

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

    #[test]
    fn what_is_missing_is_named() {
        let camera = Camera::from_k([400.0, 0.0, 20.0, 0.0, 400.0, 15.0, 0.0, 0.0, 1.0], 1, 1);
        let camera = camera.ok().map(Intrinsics);
        let place =
            (Some(Rotation(UnitQuaternion::identity(), None)), Some(Numbers([10.0, 0.0, 0.0])));
        let missing = |camera, place| DepthCamera::new(camera, None, place).err();
        assert_eq!(missing(camera, (None, place.1)), Some("cam_R_d2c"));
        assert_eq!(missing(camera, (place.0, None)), Some("cam_t_d2c"));
        assert_eq!(missing(None, place), Some("depth_K"));
        assert!(DepthCamera::new(None, None, (None, None)).unwrap().is_none());
        let known = DepthCamera::new(camera, None, place).unwrap().unwrap();
        assert_eq!(known.t_color_depth.translation.x, 0.01);
    }
}
