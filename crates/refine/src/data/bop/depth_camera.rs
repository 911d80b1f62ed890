//! A depth camera beside the color camera.

use nalgebra::Isometry3;
use prehend_render::{Camera, DepthImage, Distortion, DistortionError, register_depth};

use super::frame::Intrinsics;
use super::numbers::{Lens, Numbers, Rotation, pose};
use crate::scene::RemapCache;

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
