//! Images through a lens from those of a pinhole, and the other way.

use nalgebra::Vector2;
use rayon::prelude::*;

use super::{Distortion, DistortionError};
use crate::camera::Camera;
use crate::image::{DepthImage, Mask, RgbImage};

/// Images of one camera made from those of another at the same place that looks in the same direction, one of them behind a lens: where each
/// pixel comes from, computed once.
#[derive(Clone, Debug)]
pub struct Remap {
    source: Camera,
    target: Camera,
    /// Position in the source image of each pixel \[px\]; NaN where there is none.
    place: Vec<[f32; 2]>,
}

impl Remap {
    /// From images of `source` behind the lens to those of the pinhole camera `target`. Crop and focal lengths of `target` are
    /// free: the source's own are good.
    pub fn undistort(source: Camera, lens: &Distortion, target: Camera) -> Self {
        Self::new(source, target, |ideal| lens.shows(ideal).then(|| lens.distort(ideal)))
    }

    /// From images of the pinhole camera `source` to those of `target` behind the lens.
    pub fn distort(source: Camera, target: Camera, lens: &Distortion) -> Self {
        Self::new(source, target, |seen| lens.undistort(seen))
    }

    fn new(
        source: Camera,
        target: Camera,
        from: impl Fn(Vector2<f64>) -> Option<Vector2<f64>> + Sync,
    ) -> Self {
        let place = |at: usize| {
            let (u, v) = ((at % target.width) as f64, (at / target.width) as f64);
            from(target.ray(u, v).xy()).map_or([f32::NAN; 2], |position| {
                [source.fx * position.x + source.cx, source.fy * position.y + source.cy]
                    .map(|p| p as f32)
            })
        };
        let count = target.width * target.height;
        let place = (0..count).into_par_iter().with_min_len(target.width.max(1)).map(place);
        Self { source, target, place: place.collect() }
    }

    /// The camera of the images made.
    pub fn camera(&self) -> &Camera {
        &self.target
    }

    /// Colors, interpolated bilinearly; black beyond the source's image.
    ///
    /// # Errors
    /// When the image does not have the size of the source camera.
    pub fn rgb(&self, image: &RgbImage) -> Result<RgbImage, DistortionError> {
        self.check(image.width(), image.height())?;
        let pixel = |&[x, y]: &[f32; 2]| {
            let inside = |p: f32, size: usize| (-0.5..=size as f32 - 0.5).contains(&p);
            if !(inside(x, image.width()) && inside(y, image.height())) {
                return [0.0; 3];
            }
            // The outer half of a border pixel has the color of its center.
            let cell = |p: f32, size: usize| {
                let p = p.clamp(0.0, size as f32 - 1.0);
                let low = p as usize;
                (p - low as f32, low, (low + 1).min(size - 1))
            };
            let (a, x0, x1) = cell(x, image.width());
            let (b, y0, y1) = cell(y, image.height());
            let at = |x: usize, y: usize| image.pixels()[y * image.width() + x];
            let (p, q, r, s) = (at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1));
            [0, 1, 2].map(|k| {
                (1.0 - b) * ((1.0 - a) * p[k] + a * q[k]) + b * ((1.0 - a) * r[k] + a * s[k])
            })
        };
        let pixels = self.place.iter().map(pixel).collect();
        Ok(RgbImage::new(self.target.width, self.target.height, pixels)?)
    }

    /// Depths (Z, which a lens does not change), each of the nearest pixel: a mean of near and far would lie on
    /// neither. 0 beyond the source's image.
    ///
    /// # Errors
    /// When the image does not have the size of the source camera.
    pub fn depth(&self, image: &DepthImage) -> Result<DepthImage, DistortionError> {
        let pixels = self.nearest(image.width(), image.height(), image.pixels(), 0.0)?;
        Ok(DepthImage::new(self.target.width, self.target.height, pixels)?)
    }

    /// A mask, each pixel of the nearest; empty beyond the source's image.
    ///
    /// # Errors
    /// When the mask does not have the size of the source camera.
    pub fn mask(&self, image: &Mask) -> Result<Mask, DistortionError> {
        let pixels = self.nearest(image.width(), image.height(), image.pixels(), false)?;
        Ok(Mask::new(self.target.width, self.target.height, pixels)?)
    }

    fn nearest<T: Copy>(
        &self,
        width: usize,
        height: usize,
        pixels: &[T],
        outside: T,
    ) -> Result<Vec<T>, DistortionError> {
        self.check(width, height)?;
        let pixel = |&[x, y]: &[f32; 2]| {
            let index = |p: f32, size: usize| {
                let p = (p + 0.5).floor();
                (p >= 0.0 && p < size as f32).then_some(p as usize)
            };
            match (index(x, width), index(y, height)) {
                (Some(x), Some(y)) => pixels[y * width + x],
                _ => outside,
            }
        };
        Ok(self.place.iter().map(pixel).collect())
    }

    fn check(&self, found_width: usize, found_height: usize) -> Result<(), DistortionError> {
        let (width, height) = (self.source.width, self.source.height);
        if (found_width, found_height) == (width, height) {
            return Ok(());
        }
        Err(DistortionError::Size { found_width, found_height, width, height })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BrownConrady;

    const WIDE: [f64; 5] = [-0.31, 0.11, 1.2e-3, -7e-4, -0.02];

    #[test]
    fn nothing_is_seen_beyond_the_fold() {
        let lens = Distortion::by_name("brown_conrady", &[-0.4, 0.0, 0.0, 0.0]).unwrap();
        let camera = Camera { fx: 10.0, fy: 10.0, cx: 19.5, cy: 0.0, width: 40, height: 1 };
        let made = Remap::undistort(camera, &lens, camera);
        let picture = made.rgb(&RgbImage::filled(40, 1, [1.0; 3])).unwrap();
        // Beyond x = 1.58 the factor is negative, and the derivative positive again.
        assert_eq!([0, 3, 36, 39].map(|x| picture.get(x, 0)), [Some([0.0; 3]); 4]);
        // The fold is at x = 0.913.
        assert_eq!((picture.get(28, 0), picture.get(29, 0)), (Some([1.0; 3]), Some([0.0; 3])));
    }

    #[test]
    fn straight_lines_become_straight() {
        // A photograph of the half-plane 2x + y < 0.1, and of a ramp along x.
        let camera = Camera { fx: 80.0, fy: 82.0, cx: 40.2, cy: 29.7, width: 80, height: 60 };
        let lens = Distortion::by_name("brown_conrady", &WIDE).unwrap();
        let ideal = |at: usize| {
            lens.undistort(camera.ray((at % 80) as f64, (at / 80) as f64).xy()).unwrap()
        };
        let count = 80 * 60;
        let ramp = (0..count).map(|at| [0.5 + 0.5 * ideal(at).x as f32; 3]).collect();
        let half = |p: Vector2<f64>| 2.0 * p.x + p.y < 0.1;
        let mask = (0..count).map(|at| half(ideal(at))).collect();
        let depth = (0..count).map(|at| if half(ideal(at)) { 0.4 } else { 0.8 }).collect();
        let made = Remap::undistort(camera, &lens, camera);
        let ramp = made.rgb(&RgbImage::new(80, 60, ramp).unwrap()).unwrap();
        let mask = made.mask(&Mask::new(80, 60, mask).unwrap()).unwrap();
        let depth = made.depth(&DepthImage::new(80, 60, depth).unwrap()).unwrap();
        for y in 4..56 {
            for x in 4..76 {
                let p = made.camera().ray(x as f64, y as f64).xy();
                let color = ramp.get(x, y).unwrap()[0];
                assert!((color - 0.5 - 0.5 * p.x as f32).abs() < 1e-3, "{x} {y}");
                if (2.0 * p.x + p.y - 0.1).abs() > 0.03 {
                    assert_eq!(mask.get(x, y), Some(half(p)));
                    assert_eq!(depth.get(x, y), Some(if half(p) { 0.4 } else { 0.8 }));
                }
            }
        }
    }

    #[test]
    fn images_of_another_size_are_refused() {
        let camera = Camera { fx: 8.0, fy: 8.0, cx: 4.0, cy: 3.0, width: 8, height: 6 };
        let made = Remap::undistort(camera, &BrownConrady::default().into(), camera);
        let wrong = made.rgb(&RgbImage::filled(8, 7, [0.0; 3]));
        assert!(matches!(wrong, Err(DistortionError::Size { found_height: 7, .. })));
    }
}
