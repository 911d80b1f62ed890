//! Images of one camera.

use std::path::{Path, PathBuf};

use prehend_render::{Camera, DepthImage, Mask, Remap, RgbImage, image_size};

use super::layout::ImagesLayout;
use crate::data::bop::{DatasetError, Lens};
use crate::data::depth_camera::DepthCamera;
use crate::data::depth_values::drop_saturated;
use crate::scene::{Observation, RemapCache};

impl ImagesLayout<'_> {
    /// What they show to a pinhole camera of the same matrix. Fields of `file` are called as they are there, after `prefix`.
    ///
    /// # Errors
    /// If an image is missing or broken, or does not fit the others.
    pub(super) fn read(&self, file: &Path, prefix: &str) -> Result<Observation, DatasetError> {
        let field = |name: &str, problem: String| {
            DatasetError::field(file, &format!("{prefix}{name}"), problem)
        };
        let folder = file.parent().unwrap_or(Path::new("."));
        let broken = |error: prehend_render::ImageError| DatasetError::unusable(file, error);
        // Of all images before one is decoded.
        let size = |path: &PathBuf| image_size(&folder.join(path)).map_err(broken);
        let color_size = self.rgb.map(size).transpose()?;
        let depth_size = self.depth.map(size).transpose()?;
        let Some((w, h)) = color_size.or(depth_size) else {
            return Err(field("rgb", "is missing, and so is depth".to_owned()));
        };
        let own = self.depth_camera(field)?;
        if own.is_some() && (self.rgb.is_none() || self.depth.is_none()) {
            // It is beside the color camera.
            let lacks = if self.rgb.is_none() { "rgb" } else { "depth" };
            return Err(field(lacks, "is missing".to_owned()));
        }
        let of = if self.rgb.is_some() { "rgb" } else { "depth" };
        let mask_size = self.mask.map(size).transpose()?;
        let others = [("depth", depth_size.filter(|_| own.is_none())), ("mask", mask_size)];
        for (name, size) in others {
            if let Some((width, height)) = size.filter(|size| *size != (w, h)) {
                let problem = format!("the image is {width}x{height} pixels, {of} is {w}x{h}");
                return Err(field(name, problem));
            }
        }
        let color = self.rgb.map(|path| RgbImage::load(&folder.join(path)).map_err(broken));
        let color = color.transpose()?;
        let depth = match (self.depth, self.depth_unit_m) {
            (None, _) => None,
            (Some(_), None) => return Err(field("depth_unit_m", "is missing".to_owned())),
            (Some(path), Some(unit)) => {
                let path = folder.join(path);
                let mut depth = DepthImage::load(&path, unit.0).map_err(broken)?;
                if let Some(warning) = drop_saturated(&mut depth, unit.0) {
                    log::warn!("{}: {warning}", path.display());
                }
                if depth.pixels().iter().all(|z| *z == 0.0) {
                    log::warn!("{}: every depth is zero", path.display());
                }
                Some(depth)
            }
        };
        let mut mask = match self.mask {
            Some(path) => Mask::load(&folder.join(path)).map_err(broken)?,
            None => Mask::filled(w, h, false),
        };
        if prefix.is_empty() && self.mask.is_some() && mask.count() == 0 {
            // Of other cameras those are left out that do not see the object.
            return Err(field("mask", "the mask is empty".to_owned()));
        }
        let camera = Camera::from_k(self.k, w, h).map_err(|e| field("K", e.to_string()))?;
        let fault = |e: prehend_render::DistortionError| DatasetError::unusable(file, e);
        let mut color = color.unwrap_or_else(|| RgbImage::filled(w, h, [0.0; 3]));
        let mut depth = match (depth, &own) {
            (Some(depth), Some(own)) => {
                let depth = own.register(depth, &camera, &RemapCache::default()).map_err(fault)?;
                if depth.pixels().iter().all(|z| *z == 0.0) {
                    let problem = "nothing that depth measured is in the color image";
                    return Err(field("cam_t_d2c", problem.to_owned()));
                }
                depth
            }
            (Some(depth), None) => depth,
            (None, _) => DepthImage::filled(w, h, 0.0),
        };
        if let Some(Lens(lens)) = &self.lens {
            let remap = Remap::undistort(camera, lens, camera);
            color = remap.rgb(&color).map_err(fault)?;
            mask = remap.mask(&mask).map_err(fault)?;
            if own.is_none() {
                depth = remap.depth(&depth).map_err(fault)?;
            }
        }
        Ok(Observation::new(camera, color, depth, mask))
    }

    /// The depth camera, if it is one of its own.
    fn depth_camera(
        &self,
        field: impl Fn(&str, String) -> DatasetError,
    ) -> Result<Option<DepthCamera>, DatasetError> {
        let intrinsics = self.depth_k.map(|k| Camera::from_k(k, 1, 1)).transpose();
        let intrinsics = intrinsics.map_err(|e| field("depth_K", e.to_string()))?;
        let place = (self.depth_rotation, self.depth_translation);
        let own = DepthCamera::new(intrinsics, self.depth_lens.map(|lens| lens.0), place);
        own.map_err(|name| field(name, "is missing".to_owned()))
    }
}
