//! The contour mode: a hard z-buffer inside the object and a smooth step across its outline.
//!
//! A pixel shows α C with the colour C of the surface and a coverage α that falls smoothly from one to zero over a narrow
//! band around the object's outline (the background of a segmented image is black). All derivatives by the pose are in
//! closed form. Where the object hides farther parts of itself, the two surfaces are blended likewise
//! (α C_near + (1−α) C_far). Jumps of colour at creases and texture seams are part of the value, but not of the derivative.

mod inner;
mod options;
mod outline;
mod pixel;
mod sums;
mod surface;
mod target;

use nalgebra::{Isometry3, Matrix6, Point3, Vector6};
use rayon::prelude::*;

pub use options::{ContourOptions, DepthOptions, Robust};
pub use sums::Counts;
pub use target::{Target, TargetError};

use crate::camera::Camera;
use crate::image::{DepthImage, RgbImage};
use crate::light::{Light, LightSample};
use crate::model::{NONE, RenderModel};
use crate::posed::{Posed, Region};
use crate::raster::{self, MISS, Visible};
use inner::{Inner, inner_contours};
pub(crate) use outline::{Band, Piece, Silhouette, outline};
use pixel::Pixel;
pub(crate) use pixel::Scene;
use sums::Sums;
pub(crate) use surface::Lighting;

/// Renders a posed object and compares it with a segmented image.
///
/// Stateless but for its settings; share it freely between threads. Results do not depend on the number of
/// threads. A pose that is not finite, or puts the object behind the camera or outside the image, renders nothing:
/// the loss is then that of the whole mask missed, with zero gradient.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContourRenderer {
    /// Settings.
    pub options: ContourOptions,
}

/// The loss of a pose: weighted squared residuals over three times the area of the target's mask \[px\], so that
/// without further channels it is the mean squared error over the mask's pixels and colour channels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Loss {
    /// Sum of the three below.
    pub total: f64,
    /// Share of the colour.
    pub color: f64,
    /// Share of the mask.
    pub mask: f64,
    /// Share of the depth.
    pub depth: f64,
    /// Numbers of pixels.
    pub counts: Counts,
}

/// A loss with its derivatives by a left twist of the pose, (translation \[m\], rotation \[rad\]), about a given centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linearised {
    /// The loss.
    pub loss: Loss,
    /// Its gradient, 2 Jᵀr / N.
    pub gradient: Vector6<f64>,
    /// JᵀJ / N: the Gauss–Newton approximation of half the loss's Hessian, so that the step is −(2 `jtj`)⁻¹ `gradient`.
    pub jtj: Matrix6<f64>,
}

/// A picture of the object alone, as the contour mode sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct ContourImage {
    /// Colour blended with the black background.
    pub color: RgbImage,
    /// Coverage α in 0..=1, row-major.
    pub coverage: Vec<f32>,
    /// Z of the surface at pixel centres \[m\], 0 where there is none.
    pub depth: DepthImage,
}

/// What a pixel sees of the object.
struct Seen {
    pixel: Pixel,
    /// A face covers the pixel's centre.
    hit: bool,
    /// The centre lies within the contour band.
    near_outline: bool,
}

/// Everything about a pose that its pixels share.
struct Frame<'a> {
    posed: Posed<'a>,
    lighting: Lighting,
    region: Region,
    pieces: Vec<Piece>,
    inner: Vec<Inner>,
    visible: Vec<Visible>,
}

impl ContourRenderer {
    /// A renderer with the given settings.
    pub fn new(options: ContourOptions) -> Self {
        Self { options }
    }

    /// The loss of `model` at pose `t_cam_object` under `light`.
    pub fn evaluate(
        &self,
        model: &RenderModel,
        t_cam_object: &Isometry3<f64>,
        light: &Light,
        target: &Target,
    ) -> Loss {
        let sums = self.sum::<false>(model, t_cam_object, &Point3::origin(), light, target);
        self.loss(&sums, target)
    }

    /// The loss, its gradient and the Gauss–Newton matrix by the twist about `center` (camera frame \[m\]).
    pub fn linearise(
        &self,
        model: &RenderModel,
        t_cam_object: &Isometry3<f64>,
        center: &Point3<f64>,
        light: &Light,
        target: &Target,
    ) -> Linearised {
        let sums = self.sum::<true>(model, t_cam_object, center, light, target);
        let (right, jtj) = sums.equations(target.normalisation);
        Linearised { loss: self.loss(&sums, target), gradient: right * 2.0, jtj }
    }

    /// The picture whose difference from the target is the loss's residual (without occluder).
    pub fn render(
        &self,
        model: &RenderModel,
        t_cam_object: &Isometry3<f64>,
        camera: &Camera,
        light: &Light,
    ) -> ContourImage {
        let frame = self.frame(model, t_cam_object, camera, light, Region::EMPTY);
        let scene = self.scene(&frame, &Point3::origin());
        let mut image = ContourImage {
            color: RgbImage::filled(camera.width, camera.height, [0.0; 3]),
            coverage: vec![0.0; camera.width * camera.height],
            depth: DepthImage::filled(camera.width, camera.height, 0.0),
        };
        for index in 0..frame.visible.len() {
            self.visit::<false>(&frame, &scene, index, |x, y, seen| {
                let at = y * camera.width + x;
                if let Some(Seen { pixel, hit, .. }) = seen {
                    image.color.pixels_mut()[at] = pixel.color;
                    image.coverage[at] = pixel.coverage;
                    image.depth.pixels_mut()[at] = if hit { pixel.z } else { 0.0 };
                }
            });
        }
        image
    }

    /// What [`Light::fit`] needs: unlit colour, normal and observed colour where the object is seen inside the
    /// mask and away from its outline.
    pub fn light_samples(
        &self,
        model: &RenderModel,
        t_cam_object: &Isometry3<f64>,
        target: &Target,
    ) -> Vec<LightSample> {
        let light = Light::ambient(1.0);
        let frame = self.frame(model, t_cam_object, &target.camera, &light, Region::EMPTY);
        let scene = self.scene(&frame, &Point3::origin());
        let mut samples = Vec::new();
        for index in 0..frame.visible.len() {
            let visible = &frame.visible[index];
            let band = Band::new(frame.pieces.iter(), &visible.region, scene.half_width);
            for (i, &face) in visible.face.iter().enumerate() {
                if face == MISS || band.piece[i] != NONE {
                    continue;
                }
                let (x, y) = visible.position(i);
                let at = y * target.camera.width + x;
                if target.coverage[at] < 1.0 || target.hides(at, 1.0 / visible.inverse_z[i]) {
                    continue;
                }
                let face = face as usize;
                let b = scene.barycentric(face, x as f32, y as f32);
                let (albedo, _, _) = surface::albedo(&frame.posed, face, b);
                let normal = frame.posed.rotation * surface::normal(&frame.posed, face, b).0;
                samples.push(LightSample { albedo, normal, observed: target.color[at] });
            }
        }
        samples
    }

    fn loss(&self, sums: &Sums, target: &Target) -> Loss {
        let n = target.normalisation;
        let (color, mask, depth) = (sums.color * n, sums.mask * n, sums.depth * n);
        Loss { total: color + mask + depth, color, mask, depth, counts: sums.counts }
    }

    fn frame<'a>(
        &self,
        model: &'a RenderModel,
        pose: &Isometry3<f64>,
        camera: &Camera,
        light: &Light,
        also: Region,
    ) -> Frame<'a> {
        let half_width = self.half_width();
        let posed = Posed::new(model, camera, pose, half_width);
        let lighting = Lighting::new(light, &posed.rotation);
        let region = posed.region.union(&also);
        let visible = raster::rasterise(&posed, &region);
        let silhouette = match posed.region == Region::EMPTY {
            true => Silhouette::default(),
            false => outline(&posed, &region, half_width),
        };
        let inner = inner_contours(&posed, &visible, silhouette.covered);
        Frame { posed, lighting, region, pieces: silhouette.outline, inner, visible }
    }

    fn scene<'a>(&self, frame: &'a Frame<'a>, center: &Point3<f64>) -> Scene<'a> {
        Scene {
            posed: &frame.posed,
            lighting: &frame.lighting,
            half_width: self.half_width(),
            twist_center: center.coords.cast(),
        }
    }

    fn half_width(&self) -> f32 {
        // A band of zero width would divide by zero.
        (self.options.half_width as f32).clamp(0.05, 64.0)
    }

    /// Calls `each` for every pixel of one block of rows, in order, with its column and row and what is seen
    /// of the object there, if anything.
    fn visit<const DERIVATIVES: bool>(
        &self,
        frame: &Frame,
        scene: &Scene,
        index: usize,
        mut each: impl FnMut(usize, usize, Option<Seen>),
    ) {
        let visible = &frame.visible[index];
        let band = Band::new(frame.pieces.iter(), &visible.region, scene.half_width);
        let inner_pieces = frame.inner.iter().map(|inner| &inner.piece);
        let inner_band = (!frame.inner.is_empty())
            .then(|| Band::new(inner_pieces, &visible.region, scene.half_width));
        for (i, &face) in visible.face.iter().enumerate() {
            let (x, y) = visible.position(i);
            let inner = inner_band.as_ref().and_then(|b| frame.inner.get(b.piece[i] as usize));
            let edge = frame.pieces.get(band.piece[i] as usize);
            let (u, v) = (x as f32, y as f32);
            let seen = if face != MISS {
                let pixel =
                    scene.inside::<DERIVATIVES>(u, v, face, visible.inverse_z[i], edge, inner);
                Some(Seen { pixel, hit: true, near_outline: edge.is_some() })
            } else {
                edge.map(|piece| {
                    let pixel = scene.outside::<DERIVATIVES>(u, v, piece);
                    Seen { pixel, hit: false, near_outline: true }
                })
            };
            each(x, y, seen);
        }
    }

    fn sum<const DERIVATIVES: bool>(
        &self,
        model: &RenderModel,
        pose: &Isometry3<f64>,
        center: &Point3<f64>,
        light: &Light,
        target: &Target,
    ) -> Sums {
        let frame = self.frame(model, pose, &target.camera, light, target.bounds);
        let scene = self.scene(&frame, center);
        let blocks: Vec<Sums> = (0..frame.visible.len())
            .into_par_iter()
            .map(|index| {
                let mut sums = Sums::new();
                let last = frame.region.x1 - 1;
                self.visit::<DERIVATIVES>(&frame, &scene, index, |x, y, seen| {
                    let at = y * target.camera.width + x;
                    self.add::<DERIVATIVES>(&mut sums, target, at, seen);
                    if DERIVATIVES && x == last {
                        sums.end_row();
                    }
                });
                sums
            })
            .collect();
        let mut total = Sums::new();
        blocks.iter().for_each(|block| total.merge(block));
        total
    }

    /// Adds the cost of a pixel of the mask that shows nothing of the object.
    fn miss(&self, sums: &mut Sums, observed: [f32; 3], coverage: f32) {
        observed.iter().for_each(|c| sums.color += self.options.robust.cost(*c).0 as f64);
        sums.mask += self.options.mask_weight * (coverage * coverage) as f64;
    }

    /// Adds the residuals of one pixel.
    #[inline]
    fn add<const DERIVATIVES: bool>(
        &self,
        sums: &mut Sums,
        target: &Target,
        at: usize,
        seen: Option<Seen>,
    ) {
        let (observed, coverage) = (target.color[at], target.coverage[at]);
        let mask_weight = self.options.mask_weight as f32;
        let Some(Seen { pixel, hit, near_outline }) = seen else {
            if coverage > 0.0 {
                self.miss(sums, observed, coverage);
                sums.counts.missed += 1;
            }
            return;
        };
        if target.hides(at, pixel.z) {
            sums.counts.hidden += 1;
            if self.options.hidden_is_missed && coverage > 0.0 {
                self.miss(sums, observed, coverage);
            }
            return;
        }
        sums.counts.covered += usize::from(hit);
        sums.counts.contour += usize::from(near_outline);
        for ((color, observed), row) in pixel.color.iter().zip(observed).zip(&pixel.color_rows) {
            let r = color - observed;
            let (cost, weight) = self.options.robust.cost(r);
            sums.color += cost as f64;
            if DERIVATIVES {
                sums.add(row, r, weight);
            }
        }
        if mask_weight > 0.0 {
            let r = pixel.coverage - coverage;
            sums.mask += (mask_weight * r * r) as f64;
            if DERIVATIVES && pixel.coverage < 1.0 {
                sums.add(&pixel.coverage_row, r, mask_weight);
            }
        }
        let (Some(options), Some(depth)) = (self.options.depth, &target.depth) else { return };
        let measured = depth.pixels()[at];
        if hit && measured > 0.0 {
            let scale = (1.0 / options.scale) as f32;
            let difference = pixel.z - measured;
            let limit = options.truncation as f32;
            let bounded = difference.max(-limit).min(limit);
            let r = pixel.depth_weight * bounded * scale;
            let weight = options.weight as f32;
            sums.depth += (weight * r * r) as f64;
            sums.counts.depth += 1;
            if DERIVATIVES {
                let along = if bounded == difference { pixel.depth_weight * scale } else { 0.0 };
                let mut row = pixel.z_row.map(|v| v * along);
                let fade = pixel.depth_weight_row;
                row.iter_mut().zip(fade).for_each(|(a, b)| *a += bounded * scale * b);
                sums.add(&row, r, weight);
            }
        }
    }
}

impl Target {
    /// Whether a known body lies in front of depth `z` \[m\] at pixel `at`.
    #[inline]
    fn hides(&self, at: usize, z: f32) -> bool {
        self.occluder.as_ref().is_some_and(|o| {
            let other = o.pixels()[at];
            other > 0.0 && other < z
        })
    }
}

#[cfg(test)]
mod tests;
