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

/// Depths of pixels side by side on one surface differ by no more than this share, unless it is nearly edge-on.
const SAME_SURFACE: f32 = 0.01;

/// Indices of four pixels around a position, and how much each counts in a bilinear mean.
struct BilinearCell {
    corners: [usize; 4],
    shares: [f32; 4],
}

impl Remap {
    /// From images of `source` behind the lens to those of the pinhole camera `target`. Crop and focal lengths of `target` are
    /// free: the source's own are good.
    pub fn undistort(source: Camera, lens: &Distortion, target: Camera) -> Self {
        Self::new(source, target, |ideal| lens.shows(ideal).then(|| lens.distort(ideal)))
    }

    /// From images of the pinhole camera `source` to those of `target` behind the lens. Where the lens shows things smaller than the
    /// pinhole does, colors should be averaged: make an image of `target` [scaled](Camera::scaled) up and
    /// [downsample](RgbImage::downsampled) it.
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

    /// Colors, interpolated bilinearly; black beyond the source's image.
    ///
    /// # Errors
    /// When the image does not have the size of the source camera.
    pub fn rgb(&self, image: &RgbImage) -> Result<RgbImage, DistortionError> {
        self.check(image.width(), image.height())?;
        let pixel = |place: &[f32; 2]| {
            let Some(BilinearCell { corners, shares }) = self.cell(place) else { return [0.0; 3] };
            let colors = corners.map(|at| image.pixels()[at]);
            [0, 1, 2].map(|k| colors.iter().zip(shares).map(|(c, share)| share * c[k]).sum())
        };
        let pixels = self.place.iter().map(pixel).collect();
        Ok(RgbImage::new(self.target.width, self.target.height, pixels)?)
    }

    /// Depths (Z, which a lens does not change). Where the four pixels around show one surface, 1/Z is interpolated
    /// bilinearly, as is exact for planes; elsewhere it is the nearest pixel's, for a mean of near and far would lie on
    /// neither. 0 beyond the source's image.
    ///
    /// # Errors
    /// When the image does not have the size of the source camera.
    pub fn depth(&self, image: &DepthImage) -> Result<DepthImage, DistortionError> {
        self.check(image.width(), image.height())?;
        let pixel = |place: &[f32; 2]| {
            let nearest = || self.nearest_pixel(place).map_or(0.0, |at| image.pixels()[at]);
            let Some(BilinearCell { corners, shares }) = self.cell(place) else { return nearest() };
            let depths = corners.map(|at| image.pixels()[at]);
            let (near, far) =
                depths.iter().fold((f32::INFINITY, 0.0f32), |(a, b), &z| (a.min(z), b.max(z)));
            if !(near > 0.0 && far < near * (1.0 + SAME_SURFACE)) {
                return nearest();
            }
            1.0 / depths.iter().zip(shares).map(|(z, share)| share / z).sum::<f32>()
        };
        let pixels = self.place.iter().map(pixel).collect();
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
        let pixel = |place: &[f32; 2]| self.nearest_pixel(place).map_or(outside, |at| pixels[at]);
        Ok(self.place.iter().map(pixel).collect())
    }

    /// Index of the source pixel that a position lies in.
    fn nearest_pixel(&self, &[x, y]: &[f32; 2]) -> Option<usize> {
        let index = |p: f32, size: usize| {
            let p = (p + 0.5).floor();
            (p >= 0.0 && p < size as f32).then_some(p as usize)
        };
        Some(index(y, self.source.height)? * self.source.width + index(x, self.source.width)?)
    }

    /// The pixels around a position of the source image.
    fn cell(&self, &[x, y]: &[f32; 2]) -> Option<BilinearCell> {
        let along = |p: f32, size: usize| {
            if !(-0.5..=size as f32 - 0.5).contains(&p) {
                return None;
            }
            // The outer half of a border pixel has the value of its center.
            let p = p.clamp(0.0, size as f32 - 1.0);
            let low = p as usize;
            Some((p - low as f32, low, (low + 1).min(size - 1)))
        };
        let (a, x0, x1) = along(x, self.source.width)?;
        let (b, y0, y1) = along(y, self.source.height)?;
        let corners = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)];
        Some(BilinearCell {
            corners: corners.map(|(x, y)| y * self.source.width + x),
            shares: [(1.0 - b) * (1.0 - a), (1.0 - b) * a, b * (1.0 - a), b * a],
        })
    }

    fn check(&self, found_width: usize, found_height: usize) -> Result<(), DistortionError> {
        let (width, height) = (self.source.width, self.source.height);
        if (found_width, found_height) == (width, height) {
            return Ok(());
        }
        Err(DistortionError::Size { found_width, found_height, width, height })
    }
}
