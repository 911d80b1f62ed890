//! The SoftRas mode: every face spreads beyond its border, and the nearest of them are blended by depth (Liu et al.,
//! "Soft Rasterizer: A Differentiable Renderer for Image-based 3D Reasoning", 2019), with the semantics of PyTorch3D
//! (Ravi et al., "Accelerating 3D Deep Learning with PyTorch3D", 2020): its mesh rasterizer and its softmax blend of colors.
//!
//! For each pixel and face, d is the squared distance from the pixel's center to the face's borders, negative inside; the
//! face is kept if it contains the center or d is below the blur radius. Of the kept, the K nearest by the depth
//! z = Σ b_i Z_i count, where the barycentric coordinates b are perspective-correct and clipped if the options say so. With
//! p = sigmoid(−d/σ) and ζ = (z_far − z)/(z_far − z_near), the pixel shows Σ w C / (Σ w + δ), w = p exp((ζ − ζ_max)/γ),
//! over a black background of weight δ = max(exp((ε − ζ_max)/γ), ε), ε = 1e-10, and its coverage is 1 − Π (1 − p).
//!
//! Where it differs from PyTorch3D:
//! - Faces with a corner at or behind the camera's plane (Z ≤ 1 mm) are left out whole, not clipped.
//! - Areas are not raised by 1e-8 before dividing by them. This shows only without perspective correction and without
//!   clipping, where coordinates then sum up to one exactly.
//! - The faces of an open mesh are lit by a normal towards the camera, as in the other mode. Those of a closed one keep
//!   their outward normals, seen from inside too.
//! - The color of a pixel is multiplied by its coverage in the loss of a pose, unless the options say otherwise: beside a background as black
//!   as that of a loss, outlines else have no derivative.
//! - The depth that is compared and shown is that of the nearest face that contains the pixel's center, because the
//!   nearest of the spread faces is biased towards the camera on slanted surfaces. Where no face contains the center it is
//!   that of the nearest kept face, and has no weight in a loss.
//!
//! Derivatives are those of the picture, to six digits of differences over the smallest steps. But the picture jumps, which
//! no derivative shows (nor do PyTorch3D's):
//! - Where a face turns over. Its area changes sign, and with it the signs of all edge functions, so that a point beside
//!   the face is clamped to the opposite border: color and depth jump all over the blur radius. Coarse meshes under a wide
//!   blur have few but large ones. For 144 faces and a blur of σ = 1e-3, the gradient's cosine with differences over ±5 mrad
//!   and ±0.5 mm is 0.90; with the jump of the one face that turns over in between taken into account, 0.99999.
//! - Where a face enters or leaves the K nearest or the blur radius. Where it is the only one there and colors are not to fade, its color does
//!   not until p is about δ, long beyond the default radius.
//!
//! Lengths in the image are pixels inside; the options are in normalized device coordinates, in which the shorter
//! side of the image is 2 long.

mod adjoint;
mod blend;
mod candidate;
mod drawn;
mod exponential;
mod face;
mod fragment;
#[cfg(test)]
mod jumps;
mod lit;
mod motion;
#[cfg(test)]
mod naive;
mod number;
mod pixel;
mod run;
mod settings;
#[cfg(test)]
mod tests;
mod tiles;

use std::sync::OnceLock;

use nalgebra::{Isometry3, Point3};

use crate::camera::Camera;
use crate::light::Light;
use crate::mode::SoftRasOptions;
use crate::model::RenderModel;
use crate::posed::Posed;
use crate::precision::double;
use crate::projected::Region;
use crate::shading::surface::PosedLight;
use crate::view::{Seen, View};
pub(crate) use drawn::{Drawn, project};
pub(crate) use face::Face;
pub(crate) use number::Wide;
pub(crate) use pixel::LEAST_SHARE;
use pixel::SoftScene;
pub(crate) use run::{RUN, Run};
pub(crate) use settings::{BACKGROUND, Settings};
pub(crate) use tiles::FaceTiles;

/// A posed model whose faces spread beyond their borders.
pub(crate) struct SoftRasView<'a> {
    scene: SoftScene<'a>,
    region: Region,
    tiles: FaceTiles,
    /// The vector instructions at hand. No sum is fused, so that results do not depend on them.
    arch: pulp::Arch,
}

impl<'a> SoftRasView<'a> {
    /// Twists turn about `center` (camera frame \[m\]). Besides the pixels that the model may cover, those of `also` are
    /// visited.
    pub(crate) fn new(
        options: &SoftRasOptions,
        model: &'a RenderModel,
        pose: &Isometry3<f64>,
        center: &Point3<f64>,
        camera: &Camera,
        light: &Light,
        also: &Region,
    ) -> Self {
        let settings = Settings::new(options, camera);
        let mut posed = Posed::new(model, camera, pose, settings.reach);
        let region = posed.projected.region.union(also);
        let lighting = PosedLight::new(light, posed.rotation);
        let (mut drawn, mut screen) = (Drawn { faces: Vec::new(), ids: Vec::new() }, Vec::new());
        if posed.projected.region != Region::EMPTY {
            let (rotation, center) = (pose.rotation.to_rotation_matrix(), pose * model.center());
            let vertices = model.positions.iter().map(|p| center + rotation * double(p));
            screen = project(camera, vertices, &posed.projected.screen);
            let facing = &mut posed.projected.facing;
            drawn = Drawn::new(&model.faces, &screen, |_| model.closed, facing, &settings);
        }
        let Drawn { faces, ids } = drawn;
        let tiles = FaceTiles::new(&faces, &region);
        let motions = faces.iter().map(|_| OnceLock::new()).collect();
        let (camera, twist_center) = (*camera, *center);
        let scene = SoftScene {
            posed,
            lighting,
            settings,
            camera,
            screen,
            faces,
            ids,
            motions,
            twist_center,
        };
        Self { scene, region, tiles, arch: pulp::Arch::new() }
    }
}

impl View for SoftRasView<'_> {
    /// One for each row of pixels.
    fn blocks(&self) -> usize {
        self.region.y1 - self.region.y0
    }

    fn right(&self) -> usize {
        self.region.x1
    }

    #[inline]
    fn visit<const DERIVATIVES: bool>(
        &self,
        block: usize,
        each: impl FnMut(usize, usize, Option<Seen>),
    ) {
        self.arch.dispatch(TileWalk::<DERIVATIVES, _> { view: self, block, each });
    }
}

/// The work on one row of pixels, compiled for each set of vector instructions.
struct TileWalk<'a, const DERIVATIVES: bool, F> {
    view: &'a SoftRasView<'a>,
    block: usize,
    each: F,
}

impl<const DERIVATIVES: bool, F> pulp::WithSimd for TileWalk<'_, DERIVATIVES, F>
where
    F: FnMut(usize, usize, Option<Seen>),
{
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(mut self, simd: S) {
        let (scene, region) = (&self.view.scene, &self.view.region);
        let y = region.y0 + self.block;
        let near = |index: &&u32| scene.faces[**index as usize].touches_row(y);
        let tiles = self.view.tiles.rows().nth(self.block / RUN).unwrap_or_default();
        let mut run = Run::new(Wide::zero(simd));
        for (tile, indices) in tiles.iter().enumerate() {
            let first = region.x0 + tile * RUN;
            let end = (first + RUN).min(region.x1);
            for x in (first..end).step_by(S::F32_LANES) {
                let indices = indices.iter().filter(near).copied();
                run.collect(&scene.faces, indices, [x, y], &scene.settings);
                let pixels = scene.pixels::<DERIVATIVES, _>(&mut run, x, y);
                for lane in 0..S::F32_LANES.min(end - x) {
                    let mut seen = run.shows(lane).then(|| pixels.seen::<DERIVATIVES>(lane));
                    if let Some(seen) = seen.as_mut().filter(|_| scene.settings.fade) {
                        seen.pixel.fade::<DERIVATIVES>();
                    }
                    (self.each)(x + lane, y, seen);
                }
            }
        }
    }
}
