//! The loss of a pose: a posed object compared with a segmented image, with derivatives by the pose in closed form.

mod averaged;
mod block_sums;
mod check;
mod counts;
mod kernel;
mod light_samples;
mod loss;
mod options;
mod residuals;
mod sums;
mod target;
#[cfg(test)]
pub(crate) mod tests;
mod tiles;

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3};

use averaged::Averaged;
pub use check::OptionError;
pub use counts::Counts;
pub use light_samples::light_samples;
pub use loss::{Linearized, Loss};
pub use options::{DepthOptions, LossOptions};
use residuals::Residuals;
use sums::Sums;
#[cfg(feature = "gpu")]
pub(crate) use sums::unpacked;
pub use target::{Target, TargetError};
pub use tiles::Tile;
use tiles::Tiling;

use crate::camera::Camera;
use crate::contour::ContourView;
use crate::image::{DepthImage, RgbImage};
use crate::light::Light;
use crate::mode::Mode;
use crate::model::RenderModel;
use crate::projected::Region;
use crate::softras::SoftRasView;
use crate::view::{Seen, View};

/// The largest [`PoseLoss::samples`].
const MOST_SAMPLES: usize = 16;

/// Renders a posed object and compares it with a segmented image.
///
/// ```
/// use nalgebra::{Isometry3, Vector3};
/// use prehend_geometry::shapes::cuboid;
/// use prehend_render::{Camera, Light, Mask, PoseLoss, RenderModel, Target};
///
/// let camera = Camera { fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5, width: 64, height: 48 };
/// let model = RenderModel::new(&cuboid(Vector3::repeat(0.1)))?;
/// let light = Light::headlight(0.5, 0.5);
/// let loss = PoseLoss::default();
/// // A picture of the box, as a camera would give it, and the mask of a segmentation.
/// let seen = loss.render(&model, &Isometry3::translation(0.0, 0.0, 0.4), &camera, &light);
/// let mask = Mask::new(64, 48, seen.coverage.iter().map(|a| *a > 0.5).collect())?;
/// let target = Target::new(camera, &seen.color, &mask)?;
/// // The box is believed 5 mm too far to the right: the loss falls to the left.
/// let pose = Isometry3::translation(0.005, 0.0, 0.4);
/// let at = loss.linearize(&model, &pose, &(pose * model.center()), &light, &target);
/// assert!(at.loss.total > 0.0 && at.gradient[0] > 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// Stateless but for its settings, which [`PoseLoss::check`] checks; share it freely between threads. Faces with a corner
/// behind the camera, or within a millimeter of its plane, are not drawn. Results do not depend on the number of
/// threads. A pose that is not finite, or puts the object behind the camera or outside the image, renders nothing:
/// the loss is then that of the whole mask missed, with zero gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseLoss {
    /// How visibility is softened.
    pub mode: Mode,
    /// Terms of the loss.
    pub options: LossOptions,
    /// The object is drawn with so many samples a pixel, across and down (1..=16). One takes the color at the pixel's
    /// center, and its derivative, for that of the whole pixel; with more the loss is nearer to that of a camera, whose pixels
    /// average over creases and fine texture, and takes longer accordingly. In the contour mode the derivatives are then those of
    /// such averages, from differences between the sides of samples: true to some per cent of a camera's with four.
    pub samples: usize,
}

impl Default for PoseLoss {
    fn default() -> Self {
        Self::new(Mode::default(), LossOptions::default())
    }
}

/// A picture of the object alone, as the mode sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseImage {
    /// Color blended with the black background.
    pub color: RgbImage,
    /// Coverage α in 0..=1, row-major.
    pub coverage: Vec<f32>,
    /// Z of the surface at pixel centers \[m\], 0 where there is none; with several samples a pixel, their mean.
    pub depth: DepthImage,
}

impl PoseLoss {
    /// A loss of the given settings.
    pub fn new(mode: Mode, options: LossOptions) -> Self {
        Self { mode, options, samples: 1 }
    }

    /// Loss with `samples` by `samples` samples a pixel.
    pub fn with_samples(self, samples: usize) -> Self {
        Self { samples, ..self }
    }

    /// The loss of `model` at pose `t_cam_object` under `light`.
    pub fn evaluate(
        &self,
        model: &RenderModel,
        t_cam_object: &Isometry3<f64>,
        light: &Light,
        target: &Target,
    ) -> Loss {
        let (center, whole) = (Point3::origin(), Tiling::WHOLE);
        let tiles = self.sums::<false>(model, t_cam_object, &center, light, target, whole);
        Sums::total(&tiles).loss(target)
    }

    /// The loss, its gradient and the Gauss–Newton matrix by the twist about `center` (camera frame \[m\]).
    pub fn linearize(
        &self,
        model: &RenderModel,
        t_cam_object: &Isometry3<f64>,
        center: &Point3<f64>,
        light: &Light,
        target: &Target,
    ) -> Linearized {
        let tiles = self.sums::<true>(model, t_cam_object, center, light, target, Tiling::WHOLE);
        Sums::total(&tiles).linearized(target)
    }

    /// The loss by square tiles of the image, `side` pixels wide and high from its upper left corner on, each with the derivatives by a twist of
    /// what is seen in it alone: for bodies that are not quite rigid, or models that are not quite the body. Together the
    /// tiles are what [`linearize`](Self::linearize) gives; tiles to which no pixel is drawn or missed may be left out.
    pub fn linearize_tiles(
        &self,
        model: &RenderModel,
        t_cam_object: &Isometry3<f64>,
        center: &Point3<f64>,
        light: &Light,
        target: &Target,
        side: usize,
    ) -> Vec<Tile> {
        let tiling = Tiling::new(side);
        let tiles = self.sums::<true>(model, t_cam_object, center, light, target, tiling);
        let tile = |([column, row], sums): ([usize; 2], Sums)| Tile {
            column,
            row,
            at: sums.linearized(target),
        };
        tiles.into_iter().map(tile).collect()
    }

    /// The picture whose difference from the target is the loss's residual (without occluder).
    pub fn render(
        &self,
        model: &RenderModel,
        t_cam_object: &Isometry3<f64>,
        camera: &Camera,
        light: &Light,
    ) -> PoseImage {
        struct Picture<'a>(&'a Camera);

        impl Task for Picture<'_> {
            type Output = PoseImage;

            fn run(self, view: &impl View) -> PoseImage {
                picture(view, self.0)
            }
        }

        let (center, also) = (Point3::origin(), Region::EMPTY);
        self.view(model, t_cam_object, &center, camera, light, &also, Picture(camera))
    }

    /// Runs a task on the view that the mode and the samples ask for.
    #[allow(clippy::too_many_arguments)] // a view's own, and the task
    fn view<T: Task>(
        &self,
        model: &RenderModel,
        pose: &Isometry3<f64>,
        center: &Point3<f64>,
        camera: &Camera,
        light: &Light,
        also: &Region,
        task: T,
    ) -> T::Output {
        let samples = self.samples.clamp(1, MOST_SAMPLES);
        let fine = camera.scaled(samples as f64);
        let also = also.scaled(samples);
        match &self.mode {
            Mode::Contour(options) => {
                let drawing = options.drawing(samples);
                let view = ContourView::new(drawing, model, pose, center, &fine, light, &also);
                if samples == 1 { task.run(&view) } else { task.run(&Averaged::new(view, samples)) }
            }
            Mode::SoftRas(options) => {
                let view = SoftRasView::new(options, model, pose, center, &fine, light, &also);
                if samples == 1 { task.run(&view) } else { task.run(&Averaged::new(view, samples)) }
            }
        }
    }

    /// The sums over each tile of the view of all that `target` is compared with, by column and row.
    fn sums<const DERIVATIVES: bool>(
        &self,
        model: &RenderModel,
        pose: &Isometry3<f64>,
        center: &Point3<f64>,
        light: &Light,
        target: &Target,
        tiling: Tiling,
    ) -> BTreeMap<[usize; 2], Sums> {
        struct ByTiles<'a, const DERIVATIVES: bool>(Residuals<'a>, Tiling);

        impl<const DERIVATIVES: bool> Task for ByTiles<'_, DERIVATIVES> {
            type Output = BTreeMap<[usize; 2], Sums>;

            fn run(self, view: &impl View) -> Self::Output {
                self.0.by_tiles::<DERIVATIVES>(view, self.1)
            }
        }

        let residuals = Residuals { options: &self.options, target };
        let task = ByTiles::<DERIVATIVES>(residuals, tiling);
        let (camera, also) = (&target.camera, &target.bounds);
        // One of rayon's threads takes all of it, or each of its parallel loops would hand over and wait.
        rayon::scope(|_| self.view(model, pose, center, camera, light, also, task))
    }
}

/// Something to do with a view of whatever kind.
trait Task {
    type Output;

    fn run(self, view: &impl View) -> Self::Output;
}

fn picture(view: &impl View, camera: &Camera) -> PoseImage {
    let mut image = PoseImage {
        color: RgbImage::filled(camera.width, camera.height, [0.0; 3]),
        coverage: vec![0.0; camera.width * camera.height],
        depth: DepthImage::filled(camera.width, camera.height, 0.0),
    };
    for block in 0..view.blocks() {
        view.visit::<false>(block, |x, y, seen| {
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
