//! Rendering: the difference between the segmented image and the object rendered at the pose.

use std::sync::Arc;

use nalgebra::{Isometry3, SMatrix};
use prehend_render::{
    ContourOptions, DepthImage, Light, LossOptions, Mode, PoseLoss, Robust, Target, TargetError,
    Tile, light_samples,
};

use super::patch_sums::PatchSums;
use super::{SurfacePatches, Term};
use crate::error::RefineError;
use crate::problem::{Block, Normal, State};
use crate::scene::{Object, Observation};

/// Settings of the rendering term.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderingSettings {
    /// The image is made smaller by this factor.
    pub downsample: usize,
    /// Whether colors are compared.
    pub color: bool,
    /// Standard deviation of a color, relative to the object's brightness in the image: exposure is
    /// unknown, and a dark image is no better evidence than a bright one.
    pub sigma: f64,
    /// Standard deviation of the silhouette's coverage of a pixel (0..=1).
    pub mask_sigma: f64,
    /// Color residual beyond which an outlier is forgiven, in standard deviations.
    pub outlier: f64,
    /// How many independent measurements the pixels amount to: the errors of shading, texture and
    /// segmentation reach over whole patches.
    pub effective_pixels: f64,
    /// Pull of the estimated light towards the same from everywhere; see [`Light::fit`].
    pub light_ridge: f64,
}

/// Half-width of the contour band \[px\] that is nearest to how a box-filtered edge fades.
const HALF_WIDTH: f64 = 0.645;

/// Distance from where the object is not seen of the pixels that the light is solved from \[px\], and their number at most.
const LIGHT_MARGIN: usize = 1;
const LIGHT_SAMPLES: usize = 1000;

impl Default for RenderingSettings {
    fn default() -> Self {
        Self {
            downsample: 2,
            color: true,
            sigma: 0.15,
            mask_sigma: 0.3,
            outlier: 2.0,
            effective_pixels: 200.0,
            light_ridge: 1e-2,
        }
    }
}

/// The segmented image that a [`RenderingTerm`] compares with, made once for all terms of one size of image.
#[derive(Clone)]
pub(crate) struct Segmented {
    target: Arc<Target>,
    /// Root mean square of the colors under the mask.
    brightness: f64,
}

impl Segmented {
    /// The object in `observation`; `hand` is the depth image of what may hide it.
    ///
    /// # Errors
    /// If the images do not fit the camera or the mask is empty.
    pub(crate) fn new(observation: &Observation, hand: DepthImage) -> Result<Self, RefineError> {
        let target = Target::new(observation.camera, &observation.color, &observation.mask)
            .and_then(|t| t.with_occluder(hand))
            .map_err(images)?;
        Ok(Self { target: Arc::new(target), brightness: brightness(observation) })
    }

    /// The same made smaller by `factor`.
    ///
    /// # Errors
    /// If nothing of the mask is left.
    pub(crate) fn downsampled(&self, factor: usize) -> Result<Self, RefineError> {
        let target = match factor {
            1 => Arc::clone(&self.target),
            _ => Arc::new(self.target.downsampled(factor).map_err(images)?),
        };
        Ok(Self { target, ..*self })
    }
}

fn images(error: TargetError) -> RefineError {
    RefineError::Images(error.to_string())
}

/// The paper's L_DR with what it leaves open filled in.
///
/// Light: solved for in closed form at every pose ([`Term::light`]), because it is unknown. Hand: where
/// it hides the object there is no residual. Silhouette: coverage is compared with the mask, so that an
/// object as dark as the black outside the mask still has an outline.
pub struct RenderingTerm {
    object: Arc<Object>,
    target: Arc<Target>,
    loss: PoseLoss,
    /// Nats per unit of the renderer's loss.
    scale: f64,
    light_ridge: f64,
    /// Whether colors are compared.
    color: bool,
    /// Where the object may be off from its model, and the width of the patches' tiles in the image at hand \[px\].
    patches: Option<(Arc<SurfacePatches>, usize)>,
}

impl RenderingTerm {
    /// Prepares the segmented image of `observation`; `hand` is the depth image of the hand alone.
    ///
    /// # Errors
    /// If the images do not fit the camera or the mask is empty.
    pub fn new(
        observation: &Observation,
        object: Arc<Object>,
        hand: &DepthImage,
        settings: RenderingSettings,
    ) -> Result<Self, RefineError> {
        let image = Segmented::new(observation, hand.clone())?.downsampled(settings.downsample)?;
        Ok(Self::of(image, object, settings))
    }

    /// A term for `image`, which has the size that it should have.
    pub(crate) fn of(image: Segmented, object: Arc<Object>, settings: RenderingSettings) -> Self {
        let Segmented { target, brightness } = image;
        let sigma = settings.sigma * brightness;
        let options = LossOptions {
            color_weight: if settings.color { 1.0 } else { 0.0 },
            mask_weight: (sigma / settings.mask_sigma).powi(2),
            // Or a pose could lower its loss by hiding behind the hand.
            penalize_occluded: true,
            robust: Robust::Cauchy(settings.outlier * sigma),
            ..LossOptions::default()
        };
        Self {
            object,
            target,
            loss: PoseLoss::new(
                Mode::Contour(ContourOptions {
                    half_width: HALF_WIDTH,
                    ..ContourOptions::default()
                }),
                options,
            ),
            scale: 0.5 * settings.effective_pixels / (sigma * sigma),
            light_ridge: settings.light_ridge,
            color: settings.color,
            patches: None,
        }
    }

    /// The same where the object may be off from its model in `patches`; the image is `downsample` times smaller than theirs.
    pub(crate) fn with_patches(self, patches: Arc<SurfacePatches>, downsample: usize) -> Self {
        let side = patches.side() / downsample;
        Self { patches: Some((patches, side)), ..self }
    }
}

/// Root mean square of the colors under the mask; never zero.
fn brightness(observation: &Observation) -> f64 {
    let pixels = observation.color.pixels().iter().zip(observation.mask.pixels());
    let (sum, count) = pixels
        .filter(|(_, m)| **m)
        .flat_map(|(c, _)| c)
        .fold((0.0, 0.0), |(s, n), &v| (s + f64::from(v).powi(2), n + 1.0));
    (sum / f64::max(count, 1.0)).sqrt().max(0.02)
}

impl Term for RenderingTerm {
    fn name(&self) -> &'static str {
        "rendering"
    }

    fn value(&self, state: &State) -> f64 {
        let (model, seen) = (&self.object.model, apparent(state));
        self.scale * self.loss.evaluate(model, &seen, &state.light, &self.target).total
    }

    fn depends_on(&self, _block: Block) -> bool {
        true
    }

    fn linearize(&self, state: &State, normal: &mut Normal) -> f64 {
        let center = state.center();
        let (model, seen) = (&self.object.model, apparent(state));
        let turning = seen * self.object.center;
        // The object appears shifted, and turned as it is.
        let mut seen_by_state = SMatrix::<f64, 6, 11>::zeros();
        let place = state.camera.apparent_jacobian(&center);
        seen_by_state.fixed_view_mut::<3, 3>(0, 0).copy_from(&place.fixed_columns::<3>(0));
        seen_by_state.fixed_view_mut::<3, 5>(0, 6).copy_from(&place.fixed_columns::<5>(3));
        seen_by_state.fixed_view_mut::<3, 3>(3, 3).fill_with_identity();
        let requested = |(patches, _): &&(Arc<SurfacePatches>, usize)| {
            normal.offset(Block::SurfacePatches(patches.count())).is_some()
        };
        let patches = self.patches.as_ref().filter(requested);
        let count = patches.map_or(0, |(patches, _)| patches.count());
        // One tile for all if nobody asks for more.
        let side = patches.map_or(usize::MAX, |(_, side)| *side);
        let tiles =
            self.loss.linearize_tiles(model, &seen, &turning, &state.light, &self.target, side);
        let mut sums = PatchSums::<11>::new(count);
        let mut value = 0.0;
        for Tile { column, row, at } in tiles {
            let patch = patches.and_then(|(patches, _)| patches.in_tile(column, row));
            let (gradient, hessian) = sums.of(patch);
            *gradient += seen_by_state.tr_mul(&at.gradient) * self.scale;
            *hessian += seen_by_state.tr_mul(&at.jtj) * seen_by_state * (2.0 * self.scale);
            value += self.scale * at.loss.total;
        }
        let (gradient, hessian) = sums.equations();
        let blocks = [Block::ObjectPose, Block::Camera, Block::SurfacePatches(count)];
        normal.add_dynamic(&blocks, &gradient, &hessian);
        value
    }

    fn light(&self, state: &State) -> Option<Light> {
        if !self.color {
            return None;
        }
        let (model, pose) = (&self.object.model, apparent(state));
        // Four unknowns a channel do not need every pixel.
        let samples = light_samples(model, &pose, &self.target, LIGHT_MARGIN, LIGHT_SAMPLES);
        // With too little in view the light stays what it was.
        Light::fit(&samples, self.light_ridge).ok()
    }
}

/// Where the object appears to be to the camera as it is said to be.
fn apparent(state: &State) -> Isometry3<f64> {
    state.camera.apparent(&state.t_cam_object, &state.center())
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{assert_by_patches, assert_gradient, fixture, patches};
    use super::*;

    #[test]
    fn gradient_matches_differences() {
        for seed in 0..3 {
            let (scene, mut state, hand) = fixture(seed);
            let object = Arc::clone(&scene.object);
            let settings = RenderingSettings::default();
            let term = RenderingTerm::new(&scene.observation, object, &hand, settings).unwrap();
            state.relight(&term);
            // Pixels are in single precision and texture has kinks: a step of some hundredths of a pixel.
            assert_gradient(&term, &state, Block::ObjectPose, 5e-5, 0.03);
            state.camera = state.camera.changed(&[0.0, 0.0, 1e-3, -1e-3, 3e-3]);
            state.relight(&term);
            // The camera moves the object as its own pose does, with that gradient's error at this state.
            assert_gradient(&term, &state, Block::Camera, 5e-5, 0.1);
        }
    }

    #[test]
    fn patches_share_what_the_object_has() {
        let (scene, mut state, hand) = fixture(1);
        for downsample in [1, 2, 3, 4] {
            let settings = RenderingSettings { downsample, ..RenderingSettings::default() };
            let patches = patches(downsample);
            let object = Arc::clone(&scene.object);
            let term = RenderingTerm::new(&scene.observation, object, &hand, settings).unwrap();
            let term = term.with_patches(Arc::clone(&patches), downsample);
            state.relight(&term);
            // Some of the object is drawn beside the mask.
            assert_by_patches(&term, &state, &patches, 0.3);
        }
    }

    #[test]
    fn the_light_is_found_and_the_truth_fits_best() {
        let (scene, state, hand) = fixture(0);
        let object = Arc::clone(&scene.object);
        let settings = RenderingSettings::default();
        let term = RenderingTerm::new(&scene.observation, object, &hand, settings).unwrap();
        let lit = |mut state: State| {
            state.relight(&term);
            state
        };
        let truth = State { t_cam_object: scene.truth, ..state.clone() };
        let unlit = term.value(&truth);
        let (truth, off) = (lit(truth), lit(state));
        assert!(term.value(&truth) < 0.5 * term.value(&off));
        assert!(term.value(&truth) < unlit);
    }
}
