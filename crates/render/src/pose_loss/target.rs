//! Target of the loss: a segmented image.

use crate::camera::{Camera, CameraError};
use crate::image::{DepthImage, Mask, RgbImage};
use crate::projected::Region;

/// A segmented image: color where the object is, black elsewhere, with optional depth and the depth of
/// known bodies that may hide the object.
#[derive(Clone, Debug)]
pub struct Target {
    pub(crate) camera: Camera,
    /// Observed color inside the mask, zero outside.
    pub(crate) color: Vec<[f32; 3]>,
    /// Share of the pixel that the mask covers, 0..=1.
    pub(crate) coverage: Vec<f32>,
    /// Z \[m\], zero where missing or outside the mask.
    pub(crate) depth: Option<DepthImage>,
    pub(crate) occluder: Option<DepthImage>,
    /// Around all covered pixels.
    pub(crate) bounds: Region,
    /// One over three times the covered area; pose-independent.
    pub(crate) normalization: f64,
}

/// Why images make no target.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TargetError {
    /// An image does not have the camera's size.
    #[error("{image} is {width} x {height}, the camera {camera_width} x {camera_height}")]
    Size {
        /// `"image"`, `"mask"`, `"depth"` or `"occluder"`.
        image: &'static str,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Columns of the camera.
        camera_width: usize,
        /// Rows of the camera.
        camera_height: usize,
    },
    /// The matte does not have a number a pixel.
    #[error("matte has {found} numbers for {expected} pixels")]
    Matte {
        /// Numbers given.
        found: usize,
        /// Pixels of the camera.
        expected: usize,
    },
    /// A color under the mask is infinite or not a number.
    #[error("pixel ({x}, {y}) has a color that is not finite")]
    NotFinite {
        /// Column.
        x: usize,
        /// Row.
        y: usize,
    },
    /// The mask is empty: there is nothing to compare with.
    #[error("mask has no pixel set")]
    EmptyMask,
    /// The camera has a focal length that is not positive, a number that is not finite, or no pixels.
    #[error(transparent)]
    Camera(#[from] CameraError),
}

impl Target {
    /// The object's colors: `image` where `mask` is set, black elsewhere.
    ///
    /// # Errors
    /// When the camera is impossible, a size differs from the camera's, no pixel of the mask is set, or a color under it is not finite.
    pub fn new(camera: Camera, image: &RgbImage, mask: &Mask) -> Result<Self, TargetError> {
        Self::reduced(camera, image, mask, 1)
    }

    /// As [`new`](Self::new), and then [`downsampled`](Self::downsampled): one pixel for every block of `factor` by `factor`.
    ///
    /// # Errors
    /// Those of both.
    pub fn reduced(
        camera: Camera,
        image: &RgbImage,
        mask: &Mask,
        factor: usize,
    ) -> Result<Self, TargetError> {
        check(&camera, "image", image.width(), image.height())?;
        check(&camera, "mask", mask.width(), mask.height())?;
        camera.check()?;
        let (image, mask) = (image.pixels(), mask.pixels());
        // Outside the mask's bounds, which is most of the image, all is zero.
        let bounds = Region::around_mask(camera.width, mask).ok_or(TargetError::EmptyMask)?;
        let broken = |at: &usize| mask[*at] && image[*at].iter().any(|v| !v.is_finite());
        if let Some(at) = bounds.indices(camera.width).find(broken) {
            return Err(TargetError::NotFinite { x: at % camera.width, y: at / camera.width });
        }
        Self::of_blocks(&camera, factor, &bounds, |at| mask[at].then(|| (image[at], 1.0)))
    }

    /// From a picture of the object over black and how much of each pixel the object covers (0..=1, row-major; a matte),
    /// which unlike a binary mask places the outline within the pixel.
    ///
    /// # Errors
    /// When the camera is impossible, a size differs from the camera's, nothing is covered, or a color where something is is not finite.
    pub fn from_matte(
        camera: Camera,
        image: &RgbImage,
        coverage: Vec<f32>,
    ) -> Result<Self, TargetError> {
        check(&camera, "image", image.width(), image.height())?;
        if coverage.len() != camera.width * camera.height {
            let (found, expected) = (coverage.len(), camera.width * camera.height);
            return Err(TargetError::Matte { found, expected });
        }
        camera.check()?;
        // A NaN is not above zero and so becomes zero.
        let coverage: Vec<f32> =
            coverage.into_iter().map(|a| if a > 0.0 { a.min(1.0) } else { 0.0 }).collect();
        let covered = image.pixels().iter().zip(&coverage);
        let color = covered.map(|(c, a)| if *a > 0.0 { *c } else { [0.0; 3] }).collect();
        let bounds = covered_region(camera.width, &coverage)?;
        Self::assemble(camera, color, coverage, bounds)
    }

    /// Adds measured depth; only what lies inside the mask is used.
    ///
    /// # Errors
    /// When its size differs from the camera's.
    pub fn with_depth(mut self, depth: &DepthImage) -> Result<Self, TargetError> {
        check(&self.camera, "depth", depth.width(), depth.height())?;
        let mut depth = depth.clone();
        for (z, coverage) in depth.pixels_mut().iter_mut().zip(&self.coverage) {
            // A NaN is not above zero and so becomes missing.
            if !(*z > 0.0 && z.is_finite() && *coverage > 0.5) {
                *z = 0.0;
            }
        }
        self.depth = Some(depth);
        Ok(self)
    }

    /// Adds the z-buffer of known bodies (see [`crate::depth_map`]). Where they are nearer than the object
    /// there is no residual and no contour.
    ///
    /// # Errors
    /// When its size differs from the camera's.
    pub fn with_occluder(mut self, occluder: DepthImage) -> Result<Self, TargetError> {
        check(&self.camera, "occluder", occluder.width(), occluder.height())?;
        self.occluder = Some(occluder);
        Ok(self)
    }

    /// The target with one pixel for every block of `factor` by `factor`: means of color and coverage, medians
    /// of depth. `factor` is at least one and at most the shorter side.
    ///
    /// # Errors
    /// When nothing of the mask is left.
    pub fn downsampled(&self, factor: usize) -> Result<Self, TargetError> {
        let factor = factor.clamp(1, self.camera.width.min(self.camera.height));
        let pixel = |at: usize| Some((self.color[at], self.coverage[at]));
        let mut target = Self::of_blocks(&self.camera, factor, &self.bounds, pixel)?;
        if let Some(depth) = &self.depth {
            target = target.with_depth(&depth.downsampled(factor))?;
        }
        if let Some(occluder) = &self.occluder {
            target = target.with_occluder(occluder.downsampled(factor))?;
        }
        Ok(target)
    }

    /// One pixel for every block of `factor` by `factor`, of an image with nothing beyond `bounds`: means of color and coverage at each index.
    fn of_blocks(
        full: &Camera,
        factor: usize,
        bounds: &Region,
        pixel: impl Fn(usize) -> Option<([f32; 3], f32)>,
    ) -> Result<Self, TargetError> {
        let factor = factor.clamp(1, full.width.min(full.height));
        let camera = if factor == 1 { *full } else { full.scaled(1.0 / factor as f64) };
        let share = 1.0 / (factor * factor) as f32;
        let pixels = camera.width * camera.height;
        let (mut color, mut coverage) = (vec![[0.0f32; 3]; pixels], vec![0.0f32; pixels]);
        let small_bounds = bounds.reduced(factor, camera.width, camera.height);
        for small in small_bounds.indices(camera.width) {
            let (x, y) = (small % camera.width, small / camera.width);
            let (c, a) = (&mut color[small], &mut coverage[small]);
            for row in y * factor..(y + 1) * factor {
                let first = row * full.width + x * factor;
                for (own, covered) in (first..first + factor).filter_map(&pixel) {
                    (0..3).for_each(|k| c[k] += share * own[k]);
                    *a += share * covered;
                }
            }
        }
        Self::assemble(camera, color, coverage, small_bounds)
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Area of the mask \[px\].
    pub fn area(&self) -> f64 {
        1.0 / (3.0 * self.normalization)
    }

    /// A target that has nothing beyond `within`.
    fn assemble(
        camera: Camera,
        color: Vec<[f32; 3]>,
        coverage: Vec<f32>,
        within: Region,
    ) -> Result<Self, TargetError> {
        let finite = |at: &usize| color[*at].iter().all(|v| v.is_finite());
        if let Some(at) = within.indices(camera.width).find(|at| !finite(at)) {
            return Err(TargetError::NotFinite { x: at % camera.width, y: at / camera.width });
        }
        // Blocks that were cut off may have been all that there was.
        let bounds = covered_region(camera.width, &coverage)?;
        let area: f64 = bounds.indices(camera.width).map(|at| f64::from(coverage[at])).sum();
        let normalization = 1.0 / (3.0 * area);
        Ok(Self { camera, color, coverage, depth: None, occluder: None, bounds, normalization })
    }
}

/// The smallest rectangle around all that is covered.
fn covered_region(width: usize, coverage: &[f32]) -> Result<Region, TargetError> {
    let mask: Vec<bool> = coverage.iter().map(|a| *a > 0.0).collect();
    Region::around_mask(width, &mask).ok_or(TargetError::EmptyMask)
}

fn check(
    camera: &Camera,
    image: &'static str,
    width: usize,
    height: usize,
) -> Result<(), TargetError> {
    if (width, height) == (camera.width, camera.height) {
        return Ok(());
    }
    Err(TargetError::Size {
        image,
        width,
        height,
        camera_width: camera.width,
        camera_height: camera.height,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera { fx: 9.0, fy: 9.0, cx: 1.5, cy: 0.5, width: 4, height: 2 };

    #[test]
    fn sizes_and_empty_masks_are_checked() {
        let image = RgbImage::filled(4, 2, [0.5; 3]);
        let mask = Mask::filled(4, 2, true);
        assert!(Target::new(CAMERA, &image, &mask).is_ok());
        let wrong = Target::new(CAMERA, &image, &Mask::filled(2, 2, true)).unwrap_err();
        assert_eq!(wrong.to_string(), "mask is 2 x 2, the camera 4 x 2");
        let empty = Target::new(CAMERA, &image, &Mask::filled(4, 2, false)).unwrap_err();
        assert_eq!(empty, TargetError::EmptyMask);
        let target = Target::new(CAMERA, &image, &mask).unwrap();
        assert!(target.clone().with_depth(&DepthImage::filled(4, 3, 1.0)).is_err());
        assert!(target.with_occluder(DepthImage::filled(3, 2, 1.0)).is_err());
        // One number too many would be a row of its own.
        let matte = Target::from_matte(CAMERA, &image, vec![1.0; 9]).unwrap_err();
        assert_eq!(matte, TargetError::Matte { found: 9, expected: 8 });
        let mut image = image;
        image.pixels_mut()[6] = [0.5, f32::NAN, 0.5];
        let bad = Target::new(CAMERA, &image, &mask).unwrap_err();
        assert_eq!(bad, TargetError::NotFinite { x: 2, y: 1 });
        let flat = Camera { fy: 0.0, ..CAMERA };
        let bad = Target::new(flat, &RgbImage::filled(4, 2, [0.5; 3]), &mask).unwrap_err();
        assert_eq!(
            bad.to_string(),
            "focal length fy is 0 px, expected more than zero and 1e9 at most"
        );
    }

    #[test]
    fn downsampling_keeps_the_total_of_color_and_coverage() {
        let image = RgbImage::filled(4, 2, [0.5, 0.25, 1.0]);
        let mut mask = Mask::filled(4, 2, false);
        mask.pixels_mut()[1] = true;
        let depth = DepthImage::filled(4, 2, 0.7);
        let target = Target::new(CAMERA, &image, &mask).unwrap().with_depth(&depth).unwrap();
        assert_eq!(target.bounds, Region { x0: 1, y0: 0, x1: 2, y1: 1 });
        let half = target.downsampled(2).unwrap();
        assert_eq!(half.coverage, [0.25, 0.0]);
        assert_eq!(half.color[0], [0.125, 0.0625, 0.25]);
        assert!((half.area() - 0.25).abs() < 1e-12);
        // A larger factor than the image has pixels is that number.
        assert_eq!(target.downsampled(100).unwrap().coverage, half.coverage);
        // A lone depth among four pixels is no evidence for the block.
        assert_eq!(half.depth.unwrap().pixels(), [0.0, 0.0]);
    }
}
